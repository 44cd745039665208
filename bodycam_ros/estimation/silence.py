"""Instants at which all cameras should have spoken, and did not: instants without measurements."""

from collections import deque
from statistics import median

from bodycam_ros.estimation.body_frame import BodyFrame

_REMEMBERED = 15  # frames whose period is remembered: a single odd one does not count
_SILENT = 1.5  # periods: one missed image is at two


class Silence:
    """Learns the period of the cameras by their own stamps, so that cameras that run freely do not look faster.

    Args:
        max_pause_s: a longer silence is not filled.
    """

    def __init__(self, max_pause_s: float) -> None:
        self._max_pause_ns = 1e9 * max_pause_s
        self._periods_ns: deque[float] = deque(maxlen=_REMEMBERED)
        self._last_ns: int | None = None

    def missing(self, frame: BodyFrame) -> tuple[int, ...]:
        """Stamps [ns] between the instant before and this one at which images are missing."""
        last_ns, self._last_ns = self._last_ns, frame.stamp_ns
        own_ns = [m.stamp_ns - m.previous_stamp_ns for m in frame.matches.values() if m.previous_stamp_ns]
        period_ns = median(self._periods_ns) if self._periods_ns else None
        if own_ns:
            self._periods_ns.append(median(own_ns))
        pause_ns = frame.stamp_ns - last_ns if last_ns is not None else 0
        if period_ns is None or not _SILENT * period_ns < pause_ns <= self._max_pause_ns or last_ns is None:
            return ()
        steps = round(pause_ns / period_ns)
        return tuple(last_ns + round(pause_ns * step / steps) for step in range(1, steps))
