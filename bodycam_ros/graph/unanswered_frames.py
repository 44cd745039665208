"""Flow control between nodes: frames without an answer yet."""

import time
from collections import deque

_PATIENCE_S = 2.0
"""Without an answer for so long no node registers this camera."""

_REMEMBERED = 1000
"""Frames for which an answer may still arrive after a long gap."""


class UnansweredFrames:
    """Frames that were sent and not answered yet.

    A tracker that runs ahead follows tracks that a prompt answer would have ended, and its frames age in a queue. It is
    better to let images wait, where the oldest can be dropped and counted.

    Attributes:
        answered_since_s: since when answers arrive, on the steady clock; None without answers.
    """

    def __init__(self) -> None:
        self._unanswered_ns: deque[int] = deque(maxlen=_REMEMBERED)
        self._progress_s = 0.0
        self._is_alone = False
        self.answered_since_s: float | None = None

    def add(self, stamp_ns: int) -> None:
        """Add a frame that is sent."""
        if not self._unanswered_ns:
            self._progress_s = time.monotonic()
        self._unanswered_ns.append(stamp_ns)

    def answer(self, stamp_ns: int) -> bool:
        """Remove a frame that is answered, and all before it; False if there is no such frame."""
        if stamp_ns not in self._unanswered_ns:
            return False
        self._progress_s = time.monotonic()
        self._is_alone = False
        self.answered_since_s = self.answered_since_s or self._progress_s
        while self._unanswered_ns and self._unanswered_ns[0] <= stamp_ns:
            self._unanswered_ns.popleft()
        return True

    def expect_no_answer(self) -> None:
        """Do not wait until the next answer: the node that answers is gone, or has just started."""
        self._is_alone = True
        self.answered_since_s = None

    def clear(self) -> None:
        """Remove all frames, because time went back."""
        self._unanswered_ns.clear()
        self.answered_since_s = None

    def must_wait(self, most_ahead: int) -> bool:
        """Whether the next frame has to wait for an answer, as so many have none; False while no node answers."""
        if len(self._unanswered_ns) < most_ahead:
            return False
        if time.monotonic() - self._progress_s > _PATIENCE_S:
            self.expect_no_answer()
        return not self._is_alone
