"""Even spacing of what comes in bursts."""

import time
from collections import deque
from collections.abc import Callable
from typing import Generic, TypeVar

T = TypeVar("T")

_LEAST_SHARE = 0.6
"""Of the time between two stamps: so long after the first the second goes on, however early it comes."""

_MOST_WAITING = 3
"""More wait where a recording is played faster than it was recorded, and then nothing is to wait."""

_LONGEST_S = 0.1


class Paced(Generic[T]):
    """Hands on stamped items, not at once where the one before has only just been handed on.

    Args:
        hand_on: called with each item, in order.
    """

    def __init__(self, hand_on: Callable[[T], None]) -> None:
        self._hand_on = hand_on
        self._waiting: deque[tuple[int, T]] = deque()
        self._handed_on_ns, self._due_s = 0, 0.0

    def add(self, stamp_ns: int, item: T) -> None:
        """Take an item, and hand on what is due."""
        self._waiting.append((stamp_ns, item))
        self.look()

    def look(self) -> None:
        """Hand on what is due; call it every few milliseconds."""
        while self._waiting and (len(self._waiting) > _MOST_WAITING or time.monotonic() >= self._due_s):
            self._next()

    def flush(self) -> None:
        """Hand on all."""
        while self._waiting:
            self._next()

    def _next(self) -> None:
        stamp_ns, item = self._waiting.popleft()
        passed_s = min(1e-9 * max(stamp_ns - self._handed_on_ns, 0), _LONGEST_S)
        self._handed_on_ns, self._due_s = stamp_ns, time.monotonic() + _LEAST_SHARE * passed_s
        self._hand_on(item)
