"""The read-out times of all cameras, of which each has its own from how its images bend while it moves.

Cameras whose images are of one size, and whose read-out times agree, are most likely of one make in one mode. A camera
that hardly moved then shares the estimate of those that did; one that contradicts them keeps its own.
"""

import math
from collections.abc import Mapping

import numpy as np

from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.readout import Readout
from bodycam_ros.registration.landmark_matches import LandmarkMatches

DOUBTFUL_S = 0.001
"""Sigma [s] of a read-out time that is reported as doubtful: at 2 rad/s it leaves a tenth of a degree."""

_SPREAD_S = 0.0001  # between units of one make: their clocks differ by some ppm, the rest is the lens' share
_AGREE = 3.0  # [sigma] cameras whose read-out times differ by more are of two makes


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
        # A camera that agrees with two makes is of the one whose time is known best.
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

    @property
    def latest(self) -> dict[str, Readout]:
        """Camera -> its own latest estimate."""
        return dict(self._latest)

    def extend(self, later: Mapping[str, Readout]) -> None:
        """Take the latest estimates of the stretch of the recording after."""
        self._latest |= later

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
        f"its read-out time is not known well ({readout}), because it moved too little. Give readout_time in its lens "
        "YAML, or turn the camera more"
    )
