"""How a long computation reports its progress."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager, contextmanager
from typing import Protocol, TypeVar

T = TypeVar("T")
R = TypeVar("R")


class Advance(Protocol):
    """Counts units of work as done."""

    def __call__(self, units: int = 1) -> None:
        """Count some more units."""


class Progress(Protocol):
    """Shows steps to a person."""

    def step(self, name: str, total: int) -> AbstractContextManager[Advance]:
        """Begin a step of ``total`` units; leaving the context ends it."""


class ShownShares(ABC):
    """Progress that is shown by the share of a step that is done."""

    @abstractmethod
    def show(self, step: str, share: float) -> None:
        """Show that so much of a step is done, 0 to 1."""

    @contextmanager
    def step(self, name: str, total: int) -> Iterator[Advance]:
        """Show a step of ``total`` units."""
        done = 0
        self.show(name, 0.0)

        def advance(units: int = 1) -> None:
            nonlocal done
            done += units
            self.show(name, done / max(1, total))

        yield advance
        self.show(name, 1.0)


def in_parallel(
    function: Callable[[T], R], items: Iterable[T], workers: int, on_result: Callable[[], object] = lambda: None
) -> Iterator[R]:
    """Results in the order of the items, as they get ready; ``on_result`` is called for each.

    Threads are enough: OpenCV computes outside the interpreter's lock. Who stops listening, as by Ctrl-C, does not wait
    for items that have not started.
    """
    pool = ThreadPoolExecutor(max_workers=workers)
    try:
        for result in pool.map(function, items):
            on_result()
            yield result
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
