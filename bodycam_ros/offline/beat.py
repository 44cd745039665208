"""Fewer images of a fast recording: the same instants of all cameras."""

import math

_HEAD_START = 0.13
"""In beats: the first image is well within its beat, and jitter of later stamps does not part the cameras."""


class Beat:
    """Picks the first image of each camera in every beat, which starts with the first image of all.

    Args:
        max_rate: beats per second [Hz]; infinite to take every image.
    """

    def __init__(self, max_rate: float) -> None:
        self._max_rate = max_rate
        self._start_ns: int | None = None
        self._latest: dict[str, int] = {}

    def is_due(self, camera: str, stamp_ns: int) -> bool:
        """Whether a camera's next image is the first in its beat."""
        if math.isinf(self._max_rate):
            return True
        if self._start_ns is None:
            self._start_ns = stamp_ns
        number = math.floor(1e-9 * (stamp_ns - self._start_ns) * self._max_rate + _HEAD_START)
        if number == self._latest.get(camera):
            return False
        self._latest[camera] = number
        return True
