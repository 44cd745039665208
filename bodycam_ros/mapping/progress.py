"""How a long computation tells what it is doing."""

from contextlib import AbstractContextManager
from typing import Protocol


class Advance(Protocol):
    """Counts units of work as done."""

    def __call__(self, units: int = 1) -> None:
        """Count some more units."""


class Progress(Protocol):
    """Shows steps to a person."""

    def step(self, name: str, total: int) -> AbstractContextManager[Advance]:
        """Begin a step of ``total`` units; leaving the context ends it."""
