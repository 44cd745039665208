"""How a long computation tells what it is doing."""

import time
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from typing import Protocol


class Advance(Protocol):
    """Counts units of work as done."""

    def __call__(self, units: int = 1) -> None:
        """Count some more units."""


class Progress(Protocol):
    """Shows steps to a person."""

    def step(self, name: str, total: int) -> AbstractContextManager[Advance]:
        """Begin a step of ``total`` units; leaving the context ends it."""


class TimedProgress:
    """Progress that also takes the time of each step: ``seconds``."""

    def __init__(self, progress: Progress) -> None:
        self._progress = progress
        self.seconds: dict[str, float] = {}

    @contextmanager
    def step(self, name: str, total: int) -> Iterator[Advance]:
        """Pass the step on and note its time."""
        start = time.monotonic()
        with self._progress.step(name, total) as advance:
            yield advance
        self.seconds[name] = time.monotonic() - start
