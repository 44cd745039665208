"""How far the clock of another computer is ahead of this one's, by questions and answers as NTP asks them.

An answer has four times: asked and answered by our clock, heard and told by the other. Half of the way there and back
is the most that a way of unequal halves can hide. Imports no ROS.
"""

import time
from collections import deque
from collections.abc import Callable
from typing import NamedTuple

_KEPT = 32

_CLOCKS_PART = 100e-6
"""[s/s] Two clocks that nobody steers: an answer says so much less with every second that it is old."""


class Ahead(NamedTuple):
    """By how much a clock is ahead of ours, and at most how wrong that is [s]."""

    seconds: float
    bound: float


class _Answer(NamedTuple):
    ahead: Ahead
    came_s: float


class ClockOfOther:
    """What is known of one other clock.

    Args:
        steady: a clock in seconds that is never set, by which answers grow old.
    """

    def __init__(self, steady: Callable[[], float] = time.monotonic) -> None:
        self._steady = steady
        self._answers: deque[_Answer] = deque(maxlen=_KEPT)

    def add(self, asked_ns: int, heard_ns: int, told_ns: int, answered_ns: int) -> None:
        """An answer has come; one whose times contradict each other is left out.

        Args:
            asked_ns: when we asked, by our clock.
            heard_ns: when the other heard it, by its clock.
            told_ns: when it answered, by its clock.
            answered_ns: when we heard that, by our clock.
        """
        way_ns = (answered_ns - asked_ns) - (told_ns - heard_ns)
        if way_ns < 0 or told_ns < heard_ns:
            return
        ahead_ns = ((heard_ns - asked_ns) + (told_ns - answered_ns)) / 2
        self._answers.append(_Answer(Ahead(1e-9 * ahead_ns, 0.5e-9 * way_ns), self._steady()))

    def forget(self) -> None:
        """It may be another computer from now on."""
        self._answers.clear()

    @property
    def ahead(self) -> Ahead | None:
        """By the answer that tells most; None if none has come."""
        now_s = self._steady()
        aged = (Ahead(a.ahead.seconds, a.ahead.bound + _CLOCKS_PART * (now_s - a.came_s)) for a in self._answers)
        return min(aged, key=lambda ahead: ahead.bound, default=None)
