"""Progress bars on the terminal."""

from collections.abc import Iterator
from contextlib import contextmanager

from rich.progress import BarColumn, MofNCompleteColumn, SpinnerColumn, TextColumn, TimeElapsedColumn
from rich.progress import Progress as RichProgress

from bodycam_ros.mapping.progress import Advance
from bodycam_ros.terminal import Terminal


class ShownProgress:
    """Progress bars on the terminal, one per step."""

    def __init__(self, bars: RichProgress) -> None:
        self._bars = bars

    @contextmanager
    def step(self, name: str, total: int) -> Iterator[Advance]:
        """A bar of ``total`` units."""
        task = self._bars.add_task(name, total=total)

        def advance(units: int = 1) -> None:
            self._bars.advance(task, units)

        yield advance
        self._bars.update(task, completed=total)


@contextmanager
def shown_progress() -> Iterator[ShownProgress]:
    """Bars that are there while the block lasts."""
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    with RichProgress(*columns, console=Terminal(stderr=True)) as bars:
        yield ShownProgress(bars)


@contextmanager
def waiting(what: str) -> Iterator[None]:
    """Say what is being done, and for how long by now, while the block lasts and nobody knows for how long it will."""
    columns = (SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn())
    terminal = Terminal(stderr=True)
    with RichProgress(*columns, console=terminal, transient=True, disable=not terminal.is_terminal) as bars:
        bars.add_task(what, total=None)
        yield
