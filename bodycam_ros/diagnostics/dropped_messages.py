"""Messages that a node could not use, and messages that were lost on the way."""

from collections import Counter
from collections.abc import Callable, Mapping


class DroppedMessages:
    """Counts dropped messages, with a warning for the first of each kind.

    Args:
        warn: takes a line of text.

    Attributes:
        counts: kind -> number since the start.
        latest: reason for the latest; empty if there was none.
    """

    def __init__(self, warn: Callable[[str], object]) -> None:
        self._warn = warn
        self._reported = 0
        self.counts: Counter[str] = Counter()
        self.latest = ""

    def add(self, kind: str, reason: str) -> None:
        """Count one; ``kind`` is the name of the count in /diagnostics ("images dropped")."""
        self.counts[kind] += 1
        self.latest = reason
        if self.counts[kind] == 1:
            self._warn(f"{reason} (reported once; /diagnostics has the count)")

    def count_new(self) -> int:
        """Number since the last call."""
        before, self._reported = self._reported, self.counts.total()
        return self._reported - before

    @property
    def values(self) -> Mapping[str, object]:
        """Figures for /diagnostics."""
        return {**self.counts, "last error": self.latest or "none"}


class LostMessages:
    """Detects lost messages of a camera: each message has the stamp of the frame before it."""

    def __init__(self) -> None:
        self._latest_ns: dict[str, int] = {}

    def add(self, camera: str, stamp_ns: int, previous_stamp_ns: int) -> bool:
        """Whether the message before this one was lost; False for the first message of a camera."""
        latest_ns = self._latest_ns.get(camera)
        self._latest_ns[camera] = stamp_ns
        # A tracker that was restarted sends a predecessor of 0.
        return latest_ns is not None and previous_stamp_ns not in (0, latest_ns)
