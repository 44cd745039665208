"""Order of a stream of stamped items: rejects stray stamps and detects that time goes back."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

T = TypeVar("T")

_LONGEST_STEP_NS = 1_000_000_000
"""A larger step may be a stray stamp: the next stamps decide whether the stream continues from there."""

_CONFIRMATIONS = 3
"""Items in a row that follow each other, but not the stream, after which the stream continues with them."""

_CONFIRMED_S = 0.5
"""Or fewer, if no other item arrives for so long."""


@dataclass(frozen=True)
class Ordered(Generic[T]):
    """An item in order.

    Attributes:
        item: the item.
        restarts: whether time went back before it.
    """

    item: T
    restarts: bool


class StampOrder(Generic[T]):
    """Puts a stream in order of its stamps.

    An item whose stamp does not follow the one before is kept back: if the next follows the stream, it was a stray.

    Args:
        on_stray: called with the reason for each item that is rejected.
    """

    def __init__(self, on_stray: Callable[[str], object]) -> None:
        self._on_stray = on_stray
        self._latest_ns: int | None = None
        self._doubtful: list[tuple[int, T]] = []
        self._doubtful_since_s = 0.0

    def add(self, stamp_ns: int, item: T) -> list[Ordered[T]]:
        """Add an item; return the items that are in order now."""
        if self._latest_ns is None or _follows(stamp_ns, self._latest_ns):
            self._reject_doubtful()
            self._latest_ns = stamp_ns
            return [Ordered(item, False)]
        if self._doubtful and not _follows(stamp_ns, self._doubtful[-1][0]):
            self._reject_doubtful()
        self._doubtful.append((stamp_ns, item))
        self._doubtful_since_s = time.monotonic()
        return self._accept_doubtful() if len(self._doubtful) >= _CONFIRMATIONS else []

    def poll(self) -> list[Ordered[T]]:
        """Items that no other has contradicted for a while; call it regularly."""
        waited_s = time.monotonic() - self._doubtful_since_s
        return self._accept_doubtful() if self._doubtful and waited_s > _CONFIRMED_S else []

    def _accept_doubtful(self) -> list[Ordered[T]]:
        doubtful, self._doubtful = self._doubtful, []
        goes_back = self._latest_ns is not None and doubtful[0][0] <= self._latest_ns
        self._latest_ns = doubtful[-1][0]
        return [Ordered(item, goes_back and number == 0) for number, (_, item) in enumerate(doubtful)]

    def _reject_doubtful(self) -> None:
        for stamp_ns, _ in self._doubtful:
            off_s = 1e-9 * (stamp_ns - (self._latest_ns or 0))
            self._on_stray(
                f"stamp {stamp_ns} ns is {off_s:+.3f} s from the one before, and the stream does not continue there"
            )
        self._doubtful = []


def _follows(stamp_ns: int, before_ns: int) -> bool:
    return before_ns < stamp_ns <= before_ns + _LONGEST_STEP_NS
