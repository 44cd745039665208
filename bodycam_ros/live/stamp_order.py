"""Order of a stream of stamped items: rejects stray stamps and detects that time goes back."""

from collections.abc import Callable
from typing import Generic, TypeVar

T = TypeVar("T")

_SHORTEST_STEP_NS, _LONGEST_STEP_NS = 1_000_000, 10_000_000_000
"""A step back, or a longer one, may be a stray stamp: the next decides whether the stream continues from there.

Stamps of a stream are no less apart than the shortest step; those of messages that are sent again may be.
"""


class StampOrder(Generic[T]):
    """Puts a stream in order of its stamps.

    An item whose stamp does not follow the one before is kept back until the next: if that follows it, the stream
    continues with both; else it was a stray.

    Args:
        on_stray: called with the reason for each item that is rejected.
    """

    def __init__(self, on_stray: Callable[[str], object]) -> None:
        self._on_stray = on_stray
        self._latest_ns: int | None = None
        self._doubtful: tuple[int, T] | None = None

    def add(self, stamp_ns: int, item: T) -> tuple[list[T], bool]:
        """Add an item; the items that are in order now, and whether time went back before the first of them."""
        latest_ns, doubtful, self._doubtful = self._latest_ns, self._doubtful, None
        follows = latest_ns is None or _follows(stamp_ns, latest_ns)
        continues = doubtful is not None and not follows and _follows(stamp_ns, doubtful[0] + _SHORTEST_STEP_NS)
        if doubtful is not None and not continues:
            off_s = 1e-9 * (doubtful[0] - (latest_ns or 0))
            self._on_stray(
                f"stamp {doubtful[0]} ns is {off_s:+.3f} s from the one before, and the stream does not continue there"
            )
        if not (follows or continues):
            self._doubtful = stamp_ns, item
            return [], False
        self._latest_ns = stamp_ns
        if doubtful is None or follows:
            return [item], False
        return [doubtful[1], item], doubtful[0] <= (latest_ns or 0)


def _follows(stamp_ns: int, before_ns: int) -> bool:
    return before_ns < stamp_ns <= before_ns + _LONGEST_STEP_NS
