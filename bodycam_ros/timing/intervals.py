"""Where a camera's stamps say that its clock was set: an interval that is no multiple of the usual one."""

from collections import deque

import numpy as np

_BREAK_NS, _BREAK_SHARE = 4_000_000, 0.2
"""So far from a multiple, or by such a share of it where images come faster; ordinary stamps wander by less."""

_STEADY_SHARE = 0.9
"""Of the intervals that must be multiples, or the camera's rate varies and a gap says nothing."""

_LEAST, _MOST = 20, 150


class Intervals:
    """The latest intervals between a camera's images, and where they broke."""

    def __init__(self) -> None:
        self._latest_ns = -1
        self._intervals: deque[int] = deque(maxlen=_MOST)
        self._breaks: deque[int] = deque(maxlen=_MOST)

    def add(self, stamp_ns: int) -> None:
        """The next image."""
        interval = stamp_ns - self._latest_ns
        first, self._latest_ns = self._latest_ns < 0, stamp_ns
        if first:
            return
        if (
            self._intervals
            and abs(interval - self._intervals[-1]) > min(_BREAK_NS, _BREAK_SHARE * self._intervals[-1])
            and self._is_break(interval)
        ):
            self._breaks.append(stamp_ns)
        else:
            self._intervals.append(interval)

    def _is_break(self, interval: int) -> bool:
        if len(self._intervals) < _LEAST:
            return False
        usual = np.array(self._intervals, np.float64)
        period = float(np.median(usual))
        least_ns = min(_BREAK_NS, _BREAK_SHARE * period)
        off = np.abs(usual - np.maximum(1.0, np.rint(usual / period)) * period)
        off_now = abs(interval - max(1.0, round(interval / period)) * period)
        return bool(off_now > least_ns and np.mean(off < least_ns) > _STEADY_SHARE)

    def first_break(self, after_ns: int, before_ns: int) -> int | None:
        """The first stamp between two that comes at an odd interval [ns]; those before are forgotten."""
        while self._breaks and self._breaks[0] <= after_ns:
            self._breaks.popleft()
        return self._breaks[0] if self._breaks and self._breaks[0] < before_ns else None
