"""Progress bars of steps that say what share of them is done."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.progress import BarColumn, Progress, TaskID, TaskProgressColumn, TextColumn, TimeElapsedColumn

from bodycam_ros.terminal import Terminal


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
