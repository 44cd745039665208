"""Progress bars on the terminal."""

import json
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    SpinnerColumn,
    TaskID,
    TaskProgressColumn,
    TextColumn,
    TimeElapsedColumn,
)
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


@contextmanager
def shown_shares() -> Iterator[Callable[[str, float], None]]:
    """A bar per step, in the order in which they begin, as long as the block lasts; called with step and share."""
    columns = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeElapsedColumn())
    with Progress(*columns, console=Terminal(stderr=True), transient=True) as progress:
        tasks: dict[str, TaskID] = {}

        def show(step: str, share: float) -> None:
            for name, task in tasks.items():
                if name != step:
                    progress.update(task, completed=1.0)
            if step not in tasks:
                tasks[step] = progress.add_task(step, total=1.0)
            progress.update(tasks[step], completed=share)

        yield show


class ToldProgress:
    """Tells how far every step is, with ``step`` and ``share``."""

    def __init__(self) -> None:
        self._told: tuple[str, float] | None = None

    def tell(self, step: str, share: float) -> None:
        """So much of a step is done, 0 to 1."""
        now = step, round(share, 2)
        if now != self._told:
            self._told = now
            sys.stdout.write(json.dumps({"step": step, "share": now[1]}) + "\n")
            sys.stdout.flush()

    @contextmanager
    def step(self, name: str, total: int) -> Iterator[Advance]:
        """A step of ``total`` units."""
        done = 0

        def advance(units: int = 1) -> None:
            nonlocal done
            done += units
            self.tell(name, done / max(1, total))

        yield advance
