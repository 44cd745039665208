"""Whether segments are where they are taken to be: their pixels show their colours as they usually do."""

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.geometry import Array

_LEAST_PIXELS = 60  # of the labels, that say something of a segment
_LOST_SHARE = 0.25  # of what it usually explains: a segment beside itself shows the background
_LEARNING = 0.1  # share of an instant in what is usual
_PATIENCE = 3  # instants in a row: a blurred limb comes back by itself
_PAUSE = 30  # instants between two searches; twice as many after each in vain

Mask = NDArray[np.bool_]


class Presence:
    """Remembers how well each segment usually explains its pixels.

    Args:
        segment_count: S.

    Attributes:
        should_search: whether a segment has been lost for long enough, and no search was made lately.
    """

    def __init__(self, segment_count: int) -> None:
        self._usual = np.full(segment_count, np.nan)
        self._lost_for = np.zeros(segment_count, np.int64)
        self._since_search = self._pause = _PAUSE
        self.should_search = False

    def lost(self, energies: Array, pixels: NDArray[np.int64]) -> Mask:
        """Which segments (S,) are lost, by what they explain (S,) of their pixels (S,)."""
        enough = pixels >= _LEAST_PIXELS
        share = energies / np.maximum(pixels, 1)
        first = enough & np.isnan(self._usual) & (share > 0.0)
        self._usual[first] = share[first]
        lost: Mask = enough & (share < _LOST_SHARE * self._usual)
        fine = enough & ~lost
        self._usual[fine] += _LEARNING * (share[fine] - self._usual[fine])
        self._lost_for = np.where(lost, self._lost_for + 1, 0)
        self._since_search += 1
        if not lost.any():
            self._pause = _PAUSE
        self.should_search = bool((self._lost_for >= _PATIENCE).any()) and self._since_search > self._pause
        if self.should_search:
            self._since_search, self._pause = 0, 2 * self._pause
        return lost
