"""What a command shows on the terminal: bars of progress, tables of sections, a verdict."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Literal

from rich.box import SIMPLE_HEAD
from rich.progress import BarColumn, Progress, TaskID, TaskProgressColumn, TextColumn, TimeElapsedColumn
from rich.table import Table
from rich.text import Text

from bodycam_ros.cli.progress_lines import ProgressLines
from bodycam_ros.cli.signals import EndingSignals
from bodycam_ros.cli.terminal import Terminal
from bodycam_ros.evaluate.sections import Section
from bodycam_ros.files.merged_lines import merge_lines
from bodycam_ros.progress import ShownShares
from bodycam_ros.results.verdict import WRONG_RESULT, Level, Verdict

_LIST_WIDTH = 27  # columns of a list at the end of a row, which is folded before a figure is

STYLES = {Level.GOOD: "green", Level.DOUBTFUL: "yellow", Level.WRONG: "bold red"}
"""Colours of text on the terminal."""


def print_verdict(terminal: Terminal, verdict: Verdict) -> int:
    """Print a line for each finding and the verdict; the exit code: 0, or that of a result that should not be used."""
    for level in sorted({finding.level for finding in verdict.findings}, reverse=True):
        for text in merge_lines(finding.text for finding in verdict.findings if finding.level is level):
            terminal.print(Text.assemble((f"{level.word}: ", STYLES[level]), text))
    terminal.print(Text(f"verdict: {verdict.text}", STYLES[verdict.level]))
    return WRONG_RESULT if verdict.level is Level.WRONG else 0


def print_sections(terminal: Terminal, sections: Iterable[Section]) -> None:
    """Print heading, notes and table of each section; rows with a warning are red."""
    for section in sections:
        _print_section(terminal, section)


def _print_section(terminal: Terminal, section: Section) -> None:
    terminal.print(
        Text.assemble("\n", (section.heading, "bold"), "  ", (" ".join(section.notes), "dim")), soft_wrap=False
    )
    content = section.table
    if content is None:
        return
    table = Table(box=SIMPLE_HEAD, padding=(0, 1, 0, 0), pad_edge=False)
    for index, heading in enumerate(content.columns):
        is_text = index in content.text_columns
        justify: Literal["left", "right"] = "left" if is_text else "right"
        # Text, not str: square brackets hold units here, not rich's markup. Folded, no letter is lost on any width.
        table.add_column(
            Text(heading.replace(" [", "\n[")),
            justify=justify,
            overflow="fold",
            max_width=_LIST_WIDTH if is_text and index and index == len(content.columns) - 1 else None,
        )
    for index, row in enumerate(content.rows):
        cells = (cell if isinstance(cell, str) else cell.text for cell in row)
        table.add_row(*map(Text, cells), style="bold red" if index in content.flagged else None)
    terminal.print(table)


class ProgressBars(ShownShares):
    """A bar for each step, in the order in which they start."""

    def __init__(self, bars: Progress) -> None:
        self._bars = bars
        self._tasks: dict[str, TaskID] = {}

    def show(self, step: str, share: float) -> None:
        """Show that so much of a step is done, 0 to 1; a signal that was lost ends the command here."""
        EndingSignals.check()
        if step not in self._tasks:
            self._tasks[step] = self._bars.add_task(step, total=1.0)
        self._bars.update(self._tasks[step], completed=share)


StepProgress = ProgressBars | ProgressLines
"""What ``shown_progress`` gives."""


@contextmanager
def shown_progress(hidden: bool = False) -> Iterator[StepProgress]:
    """Progress while the block lasts, unless it is hidden: bars on a terminal, elsewhere a line now and then."""
    columns = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeElapsedColumn())
    terminal = Terminal(stderr=True)
    if not hidden and not terminal.is_terminal:
        with ProgressLines() as lines:
            yield lines
        return
    with Progress(*columns, console=terminal, transient=True, disable=hidden) as bars:
        yield ProgressBars(bars)
