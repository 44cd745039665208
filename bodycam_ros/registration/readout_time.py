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


class ReadoutTime:
    """Estimate of a read-out time.

    Args:
        settings: what is believed before the first image.
        start: what is known of this camera's before it; one that is given stays as it is.
    """

    def __init__(self, settings: ShutterSettings, start: Readout | None = None) -> None:
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
        return self.sigma < self._settings.enough or abs(self._mean) + 3.0 * self.sigma < self._settings.least_readout

    def add(self, readout_time: float, information: float) -> None:
        """What one image says [s], and its information [1/s^2]."""
        if math.isinf(self._information):
            return
        surprise = abs(readout_time - self._mean) / math.sqrt(1.0 / max(information, 1e-9) + 1.0 / self._information)
        information *= min(1.0, self._settings.surprise / max(surprise, 1e-9)) ** 2 / self._settings.images_alike
        together = self._information + information
        self._mean += information / together * (readout_time - self._mean)
        self._information = together

    @property
    def _least(self) -> float:
        return 0.0 if math.isinf(self._information) else self._settings.least_readout
