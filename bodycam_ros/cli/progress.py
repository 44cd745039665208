"""Progress bars on the terminal."""

from collections.abc import Iterator
from contextlib import contextmanager

from rich.progress import BarColumn, Progress, TaskID, TaskProgressColumn, TextColumn, TimeElapsedColumn

from bodycam_ros.progress import Advance
from bodycam_ros.terminal import Terminal


class ProgressBars:
    """A bar for each step, in the order in which they start."""

    def __init__(self, bars: Progress) -> None:
        self._bars = bars
        self._tasks: dict[str, TaskID] = {}

    def show(self, step: str, share: float) -> None:
        """Show that so much of a step is done, 0 to 1."""
        if step not in self._tasks:
            self._tasks[step] = self._bars.add_task(step, total=1.0)
        self._bars.update(self._tasks[step], completed=share)

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


@contextmanager
def shown_progress() -> Iterator[ProgressBars]:
    """Bars that are shown while the block lasts."""
    columns = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeElapsedColumn())
    terminal = Terminal(stderr=True)
    with Progress(*columns, console=terminal, transient=True, disable=not terminal.is_terminal) as bars:
        yield ProgressBars(bars)
