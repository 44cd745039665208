"""Flow control between a tracker and the registration, which may be slower."""

import time
from collections import deque

_PATIENCE_S = 2.0
"""Without an answer for so long nobody registers this camera, and there is nothing to wait for."""


class AnsweredFrames:
    """Which frames were sent and not answered yet.

    A tracker that runs ahead follows tracks that a prompt answer would have ended, and what it sends grows old in a
    queue: better let images wait, where the oldest can be dropped and counted.

    Args:
        most_ahead: frames that may be on their way.
    """

    def __init__(self, most_ahead: int) -> None:
        self._most_ahead = most_ahead
        self._unanswered_ns: deque[int] = deque()
        self._progress_s = 0.0

    def sent(self, stamp_ns: int) -> None:
        """A frame goes out."""
        if not self._unanswered_ns:
            self._progress_s = time.monotonic()
        self._unanswered_ns.append(stamp_ns)

    def answered(self, stamp_ns: int) -> None:
        """The answer to a frame, and so to those before it."""
        self._progress_s = time.monotonic()
        while self._unanswered_ns and self._unanswered_ns[0] <= stamp_ns:
            self._unanswered_ns.popleft()

    def must_wait(self) -> bool:
        """Whether the next frame has to wait for an answer."""
        if time.monotonic() - self._progress_s > _PATIENCE_S:
            self._unanswered_ns.clear()
        return len(self._unanswered_ns) >= self._most_ahead
