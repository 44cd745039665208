"""From stamps alone: which cameras share them, and where a clock was set."""

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Stamps = NDArray[np.int64]

_SHARED_NS = 500_000  # stamps of one trigger differ by less
_SHARED_PERIOD = 0.015  # of the time between two images; free-running clocks meet so closely once in thirty
_BREAK_NS, _BREAK_SHARE = 4_000_000, 0.2  # off a multiple of the period, or by such a share; jitter is less
_STEADY_SHARE = 0.9  # of the intervals that must be multiples, or the rate varies and a gap is no break
_LEAST_INTERVALS, _MOST_INTERVALS = 20, 150


@dataclass(frozen=True)
class SharedStamps:
    """Which cameras share their stamps.

    Attributes:
        cameras: those that do: most of them, or none.
        period_ns: time between two images of a camera; the median of all [ns].
        reference: the camera whose clock is the body's.
    """

    cameras: frozenset[str]
    period_ns: int
    reference: str


def find_shared_stamps(
    stamps_ns: Mapping[str, Stamps], preferred: tuple[str, ...] = (), alone: bool = False
) -> SharedStamps:
    """Find the largest group of cameras with the same stamps.

    Args:
        stamps_ns: camera -> its stamps, ascending; at least one of one camera [ns].
        preferred: cameras that should be the reference, the first that shares the stamps.
        alone: whether there is only one camera at all, whose stamps are used as they are.
    """
    several = {camera: stamps for camera, stamps in stamps_ns.items() if len(stamps) > 1}
    if not several:
        return SharedStamps(frozenset(stamps_ns) if alone else frozenset(), 0, next(iter(stamps_ns)))
    groups = [[other for other, theirs in several.items() if share_stamps(theirs, own)] for own in several.values()]
    largest = max(groups, key=len)
    shared = frozenset(largest if alone or 2 * len(largest) > max(2, len(several)) else ())
    reference = next(camera for camera in (*preferred, *sorted(several)) if camera in (shared or several))
    period = np.median([np.median(np.diff(stamps)) for stamps in several.values()])
    return SharedStamps(shared, round(float(period)), reference)


def share_stamps(own_ns: Stamps, other_ns: Stamps) -> bool:
    """Whether most stamps (N) of a camera are those (M) of another, where both have images [ns]."""
    if np.array_equal(own_ns, other_ns):
        return True
    period_ns = float(np.median(np.diff(own_ns))) if len(own_ns) > 1 else np.inf
    inside = own_ns[(own_ns >= other_ns[0] - _SHARED_NS) & (own_ns <= other_ns[-1] + _SHARED_NS)]
    if not len(inside):
        return False
    after = np.minimum(np.searchsorted(other_ns, inside), len(other_ns) - 1)
    off_ns = np.minimum(np.abs(other_ns[after] - inside), np.abs(other_ns[np.maximum(after - 1, 0)] - inside))
    return bool(np.median(off_ns) < min(_SHARED_NS, _SHARED_PERIOD * period_ns))


class StampIntervals:
    """The latest intervals between a camera's images, and where they broke.

    Attributes:
        breaks_ns: stamps that came at an odd interval, oldest first [ns].
    """

    def __init__(self) -> None:
        self.breaks_ns: deque[int] = deque()
        self._latest_ns: int | None = None
        self._intervals: deque[int] = deque(maxlen=_MOST_INTERVALS)

    def add(self, stamp_ns: int) -> None:
        """The next image."""
        before_ns, self._latest_ns = self._latest_ns, stamp_ns
        if before_ns is None:
            return
        interval = stamp_ns - before_ns
        last = self._intervals[-1] if self._intervals else interval
        if abs(interval - last) > min(_BREAK_NS, _BREAK_SHARE * last) and self._is_break(interval):
            self.breaks_ns.append(stamp_ns)
        else:
            self._intervals.append(interval)

    def _is_break(self, interval: int) -> bool:
        if len(self._intervals) < _LEAST_INTERVALS:
            return False
        intervals = np.array([*self._intervals, interval], np.float64)
        period = float(np.median(intervals))
        off = np.abs(intervals - np.maximum(1.0, np.rint(intervals / period)) * period)
        least_ns = min(_BREAK_NS, _BREAK_SHARE * period)
        return bool(off[-1] > least_ns and np.mean(off[:-1] < least_ns) > _STEADY_SHARE)
