"""The read-out time of one camera, from how its images bend while it moves: a scalar information filter."""

import math
from dataclasses import dataclass

from bodycam_ros.camera.readout import Readout
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
