"""How many images a second of a camera are used: at high rates neighbours show nearly the same."""

import math
from collections import Counter
from dataclasses import dataclass

from bodycam_ros.settings import setting

_HEAD_START = 0.13
"""In periods: the first image is well within its period, and jitter of later stamps does not separate the cameras."""


@dataclass(frozen=True)
class ImageSettings:
    """Which images are used."""

    max_rate: float = setting(
        0.0,
        unit="Hz",
        limits=(0.0, 1000.0),
        reason="most images per second that are used of each body camera of a recording, and so most states per "
        "second; 0: all. 30 are enough for cameras of 60 or 120 Hz. With fewer, images differ so much that each one "
        "costs more time. A rate that does not divide the rate of the camera leaves uneven steps, which count as gaps",
    )


class ImageRateLimit:
    """Selects the first image of each camera in every period.

    Args:
        max_rate: periods per second [Hz]; 0 to select every image.
        start_ns: stamp where the periods start, the same for all processes: which images are used depends on it [ns].
            None: that of the first image.

    Attributes:
        left_out: camera -> images that were not selected.
    """

    def __init__(self, max_rate: float, start_ns: int | None = None) -> None:
        self._max_rate = max_rate
        self._start_ns = start_ns
        self._latest: dict[str, int] = {}
        self.left_out: Counter[str] = Counter()

    def is_due(self, camera: str, stamp_ns: int) -> bool:
        """Whether a camera's next image is the first in its period."""
        if not self._max_rate:
            return True
        if self._start_ns is None:
            self._start_ns = stamp_ns
        number = math.floor(1e-9 * (stamp_ns - self._start_ns) * self._max_rate + _HEAD_START)
        if number == self._latest.get(camera):
            self.left_out[camera] += 1
            return False
        self._latest[camera] = number
        return True

    def discard(self, camera: str) -> None:
        """Select the next image of the period, for the last one that was selected cannot be used."""
        self._latest.pop(camera, None)
