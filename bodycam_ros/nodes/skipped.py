"""What a node could not use: the first of a kind is warned about, all are counted."""

from collections import Counter
from collections.abc import Callable


class Skipped:
    """Counts by kind.

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
