"""The read-out time of one camera, from how its images bend while it moves: a scalar information filter.

Cameras whose images are of one size, and whose read-out times agree, are most likely of one make in one mode: then one
that hardly moved is known as well as those that did. One that contradicts them keeps what it found itself.
"""

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.readout import Readout
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.settings import setting


@dataclass(frozen=True)
class ShutterSettings:
    """What is believed of rows that are read out one after the other."""

    readout_sigma: float = setting(
        0.015,
        unit="s",
        limits=(0.0, 0.1),
        reason="of a read-out time before any image is seen, around zero; cameras take 0 (global shutter) to 30 ms",
    )
    images_alike: float = setting(
        6.0,
        limits=(1.0, 100.0),
        reason="images say the same because they share tracks, and so errors; each counts by as much less",
    )
    every: int = setting(
        3,
        unit="images",
        limits=(1, 100),
        reason="so many say hardly more than one of them, and each costs a pose fit; one of them is asked, for all",
    )
    least_turn: float = setting(
        0.5, unit="rad/s", limits=(0.0, 10.0), reason="a camera that turns more slowly says nothing that is worth a fit"
    )
    surprise: float = setting(
        3.0,
        unit="sigma",
        limits=(1.0, 100.0),
        reason="an image that differs by more, such as of a foot that lands, counts by the square of that less",
    )
    least_readout: float = setting(
        0.0005,
        unit="s",
        limits=(0.0, 0.01),
        reason="a shorter one is taken for none, and images are not corrected: 2 rad/s move nothing by 0.2 px",
    )
    enough: float = setting(
        0.00025,
        unit="s",
        limits=(0.0, 0.1),
        reason="a read-out time known this well is not estimated any further: 4 rad/s move the first row by 0.1 px",
    )
    turn_sigma: float = setting(
        0.5,
        unit="rad/s",
        limits=(0.01, 20.0),
        reason="by how much an image's own angular velocity differs from the one that the images before tell",
    )
    speed_sigma: float = setting(0.15, unit="m/s", limits=(0.01, 10.0), reason="the same for its velocity")


_CONTRADICTION, _OTHERWISE = 5.0, 0.3
"""Sigmas by which images differ from what was known before, and the share of it that they stay below."""

_CONFIRMATION, _CHECKED_S = 2.0, 0.0005
"""What was known before is not checked any further once the images alone agree with it to these sigmas and [s]."""


class ReadoutTime:
    """Estimate of a read-out time.

    What is known before the first image may be of another camera or video mode. The images are therefore filtered
    without it as well until they confirm it, and replace it where they contradict it.

    Args:
        settings: what is believed before the first image.
        start: what is known of this camera's before it; one that is given stays as it is.
    """

    def __init__(self, settings: ShutterSettings, start: Readout | None = None) -> None:
        self._by_images = None if start is None or start.is_given else ReadoutTime(settings)
        start = start or Readout(0.0, settings.readout_sigma)
        self._settings = settings
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
        is_exact = self.sigma < self._settings.enough
        is_known = is_exact or abs(self._mean) + 3.0 * self.sigma < self._settings.least_readout
        return is_known and (self._by_images is None or self._by_images._confirms(self))

    @property
    def unchecked(self) -> "ReadoutTime":
        """What images are asked with: by nothing that they have yet to confirm, which would hide what they show."""
        return self._by_images or self

    def contradicts(self, readout: Readout) -> bool:
        """Whether the images say so certainly that the read-out time is another."""
        if abs(readout.seconds - self._mean) < _CONTRADICTION * math.hypot(readout.sigma, self.sigma):
            return False
        # Blur and landings of a foot pull its read-out time towards zero, by a half at last and by more at first.
        is_shorter = abs(self._mean) < abs(readout.seconds)
        return not is_shorter or (self.sigma < _CHECKED_S and abs(self._mean) < _OTHERWISE * abs(readout.seconds))

    def _confirms(self, other: "ReadoutTime") -> bool:
        apart_s = abs(other.seconds - self._mean)
        return self.sigma < _CHECKED_S and apart_s < _CONFIRMATION * math.hypot(other.sigma, self.sigma)

    def add(self, readout_time: float, information: float) -> None:
        """What one image says [s], and its information [1/s^2]."""
        if math.isinf(self._information):
            return
        if self._by_images is not None:
            self._by_images.add(readout_time, information)
            if self._by_images.contradicts(Readout(self._mean, self.sigma)):
                self._mean, self._information = self._by_images._mean, self._by_images._information
                self._by_images = None
                return
        surprise = abs(readout_time - self._mean) / math.sqrt(1.0 / max(information, 1e-9) + 1.0 / self._information)
        information *= min(1.0, self._settings.surprise / max(surprise, 1e-9)) ** 2 / self._settings.images_alike
        together = self._information + information
        self._mean += information / together * (readout_time - self._mean)
        self._information = together

    @property
    def _least(self) -> float:
        return 0.0 if math.isinf(self._information) else self._settings.least_readout


_EXACT_S = 1e-9
"""No read-out time is known better [s]."""

_TURNS = 5
"""Whom the mean of the others takes in and leaves out settles within two or three."""


@dataclass(frozen=True)
class ReadoutSettings:
    """Which cameras share a read-out time, and when it is known well enough."""

    spread: float = setting(
        0.0001,
        unit="s",
        limits=(0.0, 0.01),
        reason="by how much units of one make differ: their clocks count the rows to some ppm, the rest is the lens' "
        "share in the estimate",
    )
    agree: float = setting(
        3.0, unit="sigma", limits=(1.0, 10.0), reason="cameras whose read-out times differ by more are of two makes"
    )
    doubtful: float = setting(
        0.001,
        unit="s",
        limits=(0.0, 0.1),
        reason="a camera whose read-out time is known less well is named: at 2 rad/s it leaves a tenth of a degree",
    )


def pooled(
    readouts: Mapping[str, Readout], sizes: Mapping[str, tuple[int, int]], settings: ReadoutSettings
) -> dict[str, Readout]:
    """The read-out time of every camera when all have been heard; those that are given stay as they are.

    Args:
        readouts: camera -> what it says itself.
        sizes: camera -> width and height of its images [px].
        settings: who agrees with whom.
    """
    found = dict(readouts)
    for size in {sizes[camera] for camera in readouts}:
        alike = [camera for camera in readouts if sizes[camera] == size]
        while alike:
            together = _agreeing([readouts[camera] for camera in alike], settings)
            members = [alike[row] for row in np.flatnonzero(together)]
            for camera in members:
                others = [readouts[other] for other in members if other != camera]
                found[camera] = _with_others(readouts[camera], others, settings)
            alike = [camera for camera in alike if camera not in members]
    return found


def _agreeing(readouts: list[Readout], settings: ReadoutSettings) -> NDArray[np.bool_]:
    """Which of them (N,) have one read-out time: the best known that any value finds; at least one."""
    means = np.array([readout.seconds for readout in readouts])
    variances = np.array([readout.sigma**2 + settings.spread**2 for readout in readouts])
    weights = 1.0 / np.maximum(variances, _EXACT_S**2)
    # A value is tried as it stands: one that is vague agrees with everybody, but few agree with it.
    agree = np.abs(means[:, None] - means) <= settings.agree * np.sqrt(variances)
    members: NDArray[np.bool_] = agree[np.argmax(agree @ weights)]
    for _ in range(_TURNS):
        mean = np.average(means[members], weights=weights[members])
        now = np.abs(means - mean) <= settings.agree * np.sqrt(variances + 1.0 / weights[members].sum())
        if not now.any() or np.array_equal(now, members):
            break
        members = now
    return members


def _with_others(own: Readout, others: list[Readout], settings: ReadoutSettings) -> Readout:
    """What a camera says, and others of its make, together."""
    if own.is_given or not others:
        return own
    means = np.array([readout.seconds for readout in others])
    weights = 1.0 / np.maximum([readout.sigma**2 + settings.spread**2 for readout in others], _EXACT_S**2)
    mean = float(np.average(means, weights=weights))
    # Where they scatter by more than they should, they are known less well than they say (Birge 1932).
    scatter = float(weights @ (means - mean) ** 2) / max(len(others) - 1, 1)
    variance = max(1.0, scatter) / float(weights.sum()) + settings.spread**2
    information = own.sigma**-2 + 1.0 / variance
    return Readout((own.seconds * own.sigma**-2 + mean / variance) / information, math.sqrt(1.0 / information))


@dataclass
class TypicalSpeed:
    """How fast a camera moves on average while it is registered.

    Attributes:
        latest: the last registered image; None before the first.
        angle_rad, distance_m, seconds: it went so far in so long.
    """

    latest: LandmarkMatches | None = None
    angle_rad: float = 0.0
    distance_m: float = 0.0
    seconds: float = 0.0

    def add(self, matches: LandmarkMatches) -> None:
        """The next image."""
        if matches.world_T_camera is None:
            return
        before, self.latest = self.latest, matches
        if before is None or before.world_T_camera is None or before.stamp_ns != matches.previous_stamp_ns:
            return
        # Of every image of every camera: kept to what the two numbers need.
        cosine = 0.5 * (float(np.vdot(before.world_T_camera[:3, :3], matches.world_T_camera[:3, :3])) - 1.0)
        self.angle_rad += math.acos(min(1.0, max(-1.0, cosine)))
        self.distance_m += math.dist(before.world_T_camera[:3, 3], matches.world_T_camera[:3, 3])
        self.seconds += 1e-9 * (matches.stamp_ns - before.stamp_ns)

    def within(self, seconds: float) -> tuple[float, float]:
        """How far it turns [rad] and goes [m] in some time [s]; 0 of a camera that was never seen to move."""
        share = seconds / self.seconds if self.seconds else 0.0
        return share * self.angle_rad, share * self.distance_m


class ReadoutLog:
    """Collects what the registrations of all cameras say of their read-out times.

    Args:
        cameras: their models, by name.
        settings: which cameras share a read-out time, and when it is known well enough.
        known: cameras whose read-out time was known beforehand. Others have told them already, and to ask them again
            would count the same images twice.
    """

    def __init__(
        self, cameras: Mapping[str, CameraModel], settings: ReadoutSettings, known: Collection[str] = ()
    ) -> None:
        self._known = known
        self._sizes = {camera: (model.width, model.height) for camera, model in cameras.items()}
        self._settings = settings
        self._latest: dict[str, Readout] = {}
        self._speeds = {camera: TypicalSpeed() for camera in cameras}

    def add(self, matches: LandmarkMatches) -> None:
        """The next registration of a camera; the latest one says all that its camera knows."""
        if matches.readout is not None:
            self._latest[matches.camera] = matches.readout
        self._speeds[matches.camera].add(matches)

    def readouts(self) -> dict[str, Readout]:
        """Camera -> its read-out time, with the help of those of its make."""
        alone = {camera: readout for camera, readout in self._latest.items() if camera not in self._known}
        return self._latest | pooled(alone, self._sizes, self._settings)

    def doubts(self) -> dict[str, str]:
        """Camera -> what is not known of its read-out time, and what that may cost, of those that are doubtful."""
        return {
            camera: f"camera {camera}: {doubt(readout, self._speeds[camera])}"
            for camera, readout in sorted(self.readouts().items())
            if readout.sigma > self._settings.doubtful
        }


def doubt(readout: Readout, speed: TypicalSpeed) -> str:
    """What a read-out time that is hardly known may cost."""
    angle_rad, distance_m = speed.within(readout.sigma)
    return (
        f"it moved too little to tell how long its rows are read out ({readout}); at its usual speed that may leave "
        f"{1e3 * distance_m:.1f} mm and {np.degrees(angle_rad):.2f} deg. Give readout_time in its lens YAML, or turn "
        "it more"
    )
