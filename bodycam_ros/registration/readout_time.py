"""The read-out time of one camera, from how its images bend while it moves: a scalar information filter.

Cameras whose images are of one size, and whose read-out times agree, are most likely of one make in one mode. A camera
that hardly moved then shares the estimate of those that did; one that contradicts them keeps its own.
"""

import math
from collections.abc import Mapping

import numpy as np

from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.readout import Readout
from bodycam_ros.registration.landmark_matches import LandmarkMatches

EVERY = 3
"""Images of which one is used, for all: neighbours are strongly correlated, and each costs a pose fit."""

LEAST_TURN = 0.5
"""[rad/s] images of a camera that turns more slowly carry too little information for a fit."""

DOUBTFUL_S = 0.001
"""Sigma [s] of a read-out time that is reported as doubtful: at 2 rad/s it leaves a tenth of a degree."""

_FIRST_SIGMA_S = 0.015  # before any image, around zero; cameras take 0 (global shutter) to 30 ms
_IMAGES_ALIKE = 6.0  # images share tracks, and so errors; the information of each is divided by this
_SURPRISE = 3.0  # [sigma] an image that differs by more, such as of a foot that lands, is down-weighted by its square
_LEAST_S = 0.0005  # a shorter read-out is taken for none: 2 rad/s move nothing by 0.2 px
_ENOUGH_S = 0.00025  # sigma at which the estimate ends: 4 rad/s move the first row by 0.1 px

_SPREAD_S = 0.0001  # between units of one make: their clocks differ by some ppm, the rest is the lens' share
_AGREE = 3.0  # [sigma] cameras whose read-out times differ by more are of two makes


class ReadoutTime:
    """Estimate of a read-out time.

    Args:
        start: what is known of this camera's before the first image; one that is given stays as it is.
        images_alike: correlation of the images, see ``_IMAGES_ALIKE``.
    """

    def __init__(self, start: Readout | None = None, images_alike: float = _IMAGES_ALIKE) -> None:
        start = start or Readout(0.0, _FIRST_SIGMA_S)
        self._images_alike = images_alike
        self._mean = start.seconds
        self._information = start.sigma**-2 if start.sigma > 0.0 else math.inf

    @property
    def seconds(self) -> float:
        """From the exposure of the first row to that of the last [s]."""
        return self._mean

    @property
    def sigma(self) -> float:
        """Standard deviation [s]; 0 of one that was given."""
        return 1.0 / math.sqrt(self._information)

    @property
    def in_use(self) -> float:
        """What images are corrected by [s]: zero as long as it cannot be told from zero."""
        return self._mean if abs(self._mean) > max(self._least, 2.0 * self.sigma) else 0.0

    @property
    def is_known(self) -> bool:
        """Whether more images would not make it better."""
        return self.sigma < _ENOUGH_S or abs(self._mean) + 3.0 * self.sigma < _LEAST_S

    def add(self, readout_time: float, information: float) -> None:
        """The estimate of one image [s], and its information [1/s^2]."""
        if math.isinf(self._information):
            return
        surprise = abs(readout_time - self._mean) / math.sqrt(1.0 / max(information, 1e-9) + 1.0 / self._information)
        information *= min(1.0, _SURPRISE / max(surprise, 1e-9)) ** 2 / self._images_alike
        together = self._information + information
        self._mean += information / together * (readout_time - self._mean)
        self._information = together

    @property
    def _least(self) -> float:
        return 0.0 if math.isinf(self._information) else _LEAST_S


def pooled(readouts: Mapping[str, Readout], sizes: Mapping[str, tuple[int, int]]) -> dict[str, Readout]:
    """The read-out time of every camera by all cameras alike; given ones stay as they are.

    Args:
        readouts: camera -> its own estimate.
        sizes: camera -> width and height of its images [px].
    """

    def agree(one: Readout, other: Readout) -> bool:
        return abs(one.seconds - other.seconds) <= _AGREE * math.hypot(one.sigma, other.sigma, _SPREAD_S)

    found = dict(readouts)
    for camera, own in readouts.items():
        alike = [each for name, each in readouts.items() if name != camera and sizes[name] == sizes[camera]]
        alike = [each for each in alike if agree(own, each)]
        if own.is_given or not alike:
            continue
        # Of two makes that it agrees with, that of the best known.
        best = min(alike, key=lambda each: each.sigma)
        others = [each for each in alike if agree(best, each)]
        weights = np.array([1.0 / (each.sigma**2 + _SPREAD_S**2) for each in others])
        mean, variance = weights @ [each.seconds for each in others] / weights.sum(), 1.0 / weights.sum() + _SPREAD_S**2
        information = own.sigma**-2 + 1.0 / variance
        seconds = (own.seconds * own.sigma**-2 + mean / variance) / information
        found[camera] = Readout(float(seconds), float(information**-0.5))
    return found


class ReadoutLog:
    """Collects the read-out times of all cameras.

    Args:
        cameras: their models, by name.
    """

    def __init__(self, cameras: Mapping[str, CameraModel]) -> None:
        self._sizes = {camera: (model.width, model.height) for camera, model in cameras.items()}
        self._latest: dict[str, Readout] = {}

    def add(self, matches: LandmarkMatches) -> None:
        """The next registration of a camera; its estimate replaces the one before."""
        if matches.readout is not None:
            self._latest[matches.camera] = matches.readout

    def readouts(self) -> dict[str, Readout]:
        """Camera -> its read-out time, pooled with those of its make."""
        return pooled(self._latest, self._sizes)

    def doubts(self) -> dict[str, str]:
        """Camera -> message about its read-out time, of those that are not known well."""
        return {
            camera: f"camera {camera}: {doubt(readout)}"
            for camera, readout in sorted(self.readouts().items())
            if readout.sigma > DOUBTFUL_S
        }


def doubt(readout: Readout) -> str:
    """Message about a read-out time that is not known well."""
    return (
        f"it moved too little to tell how long its rows are read out ({readout}). Give readout_time in its lens YAML, "
        "or turn it more"
    )
