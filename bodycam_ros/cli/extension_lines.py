"""What is said of rounds over a recording: their progress, and what each brought."""

from collections.abc import Sequence

from rich.progress import Progress, TaskID
from rich.table import Table

from bodycam_ros.growth.extension_round import ExtensionRound
from bodycam_ros.offline.extend import OnProgress
from bodycam_ros.terminal import Terminal


def shown_steps(bars: Progress) -> OnProgress:
    """What shows every step as a bar of its own."""
    tasks: dict[str, TaskID] = {}

    def show(step: str, share: float) -> None:
        if step not in tasks:
            tasks[step] = bars.add_task(step, total=1.0)
        bars.update(tasks[step], completed=share)

    return show


def print_rounds(rounds: Sequence[ExtensionRound]) -> None:
    """Share of registered images per camera and round."""
    heads = [f"{number + 1} {'back' if one.backwards else 'forth'}" for number, one in enumerate(rounds)]
    table = Table("camera", *heads, title="registered by then [%]")
    for camera in sorted(rounds[0].shares):
        table.add_row(camera, *[f"{100 * one.shares[camera]:.1f}" for one in rounds])
    table.add_row("all", *[f"{100 * one.share:.1f}" for one in rounds], style="bold")
    Terminal().print(table)
    Terminal().print(f"{100 * rounds[0].absolute:.1f} % of all images are held by landmarks of the photographs")
