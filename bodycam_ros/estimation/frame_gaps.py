"""Frames that are missing between two others."""

import math
from collections import deque
from statistics import median

from bodycam_ros.body_state import BodyFrame

_PERIODS = 15  # frames whose period is remembered: a single odd one does not count
_GAP = 1.5  # periods without a frame are a gap: one missed frame is at two


class FrameGaps:
    """Finds missing frames by the period of the cameras' own stamps, which free-running cameras do not shorten.

    Attributes:
        period_ns: of the frames [ns]; infinite before the second.
    """

    def __init__(self) -> None:
        self._periods_ns: deque[float] = deque(maxlen=_PERIODS)
        self._last_ns: int | None = None
        self.period_ns = math.inf

    def missing_stamps(self, frame: BodyFrame, max_pause_s: float) -> tuple[int, ...]:
        """Stamps [ns] between the frame before and this one at which images are missing; none in a longer pause."""
        last_ns, self._last_ns = self._last_ns, frame.stamp_ns
        own_ns = [m.stamp_ns - m.previous_stamp_ns for m in frame.matches.values() if m.previous_stamp_ns]
        period_ns = self.period_ns
        if own_ns:
            self._periods_ns.append(median(own_ns))
            self.period_ns = median(self._periods_ns)
        pause_ns = frame.stamp_ns - last_ns if last_ns is not None else 0
        if last_ns is None or not _GAP * period_ns < pause_ns <= 1e9 * max_pause_s:
            return ()
        steps = round(pause_ns / period_ns)
        return tuple(last_ns + round(pause_ns * step / steps) for step in range(1, steps))
