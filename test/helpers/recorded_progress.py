"""Progress that is not shown, with the units of each step."""

from collections.abc import Iterator
from contextlib import contextmanager

from bodycam_ros.progress import Advance


class Unshown:
    """Counts the units of each step."""

    def __init__(self) -> None:
        self.done: dict[str, int] = {}
        self.totals: dict[str, int] = {}

    @contextmanager
    def step(self, name: str, total: int) -> Iterator[Advance]:
        self.done[name], self.totals[name] = 0, total

        def advance(units: int = 1) -> None:
            self.done[name] += units

        yield advance
