"""What nodes remember about frames on their way: sent and not answered, lost, left out. Imports no ROS."""

import time
from collections import Counter, deque
from collections.abc import Callable

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


class MissedFrames:
    """Whether messages of a camera got lost on the way: each names the frame before it."""

    def __init__(self) -> None:
        self._latest_ns: dict[str, int] = {}
        self.count = 0
        """Messages whose predecessor never arrived."""

    def add(self, camera: str, stamp_ns: int, previous_stamp_ns: int) -> bool:
        """Whether the message's predecessor is missing; the first message of a camera has none to miss."""
        latest_ns = self._latest_ns.get(camera)
        self._latest_ns[camera] = stamp_ns
        # A predecessor of 0 is a tracker that has started again.
        missed = latest_ns is not None and previous_stamp_ns not in (0, latest_ns)
        self.count += missed
        return missed


class Skipped:
    """What a node could not use: the first of a kind is warned about, all are counted.

    Args:
        warn: takes a line of text.
    """

    def __init__(self, warn: Callable[[str], object]) -> None:
        self._warn = warn
        self.counts: Counter[str] = Counter()

    def add(self, kind: str, reason: str) -> None:
        """Count one; ``kind`` is how the count is called in /diagnostics ("images skipped")."""
        self.counts[kind] += 1
        if self.counts[kind] == 1:
            self._warn(f"{reason} (said once; /diagnostics counts them)")
