"""Tables, sections of reports, and the verdict, on the terminal."""

from typing import TYPE_CHECKING, Literal

from rich.box import SIMPLE_HEAD
from rich.table import Table
from rich.text import Text

from bodycam_ros.terminal import Terminal
from bodycam_ros.verdict import WRONG_RESULT, Level, Verdict

if TYPE_CHECKING:
    from bodycam_ros.evaluate.sections import Section

_LIST_WIDTH = 27  # columns of a list at the end of a row, which is folded before a figure is

STYLES = {Level.GOOD: "green", Level.DOUBTFUL: "yellow", Level.WRONG: "bold red"}
"""Of text on the terminal."""


def print_verdict(terminal: Terminal, verdict: Verdict) -> None:
    """Print a line for each finding and the verdict."""
    for finding in verdict.findings:
        line = Text.assemble((f"{finding.level.word}: ", STYLES[finding.level]), finding.text)
        terminal.print(line, soft_wrap=True)
    terminal.print(Text(f"verdict: {verdict.text}", STYLES[verdict.level]), soft_wrap=True)


def exit_code(verdict: Verdict) -> int:
    """0, or that of a result that should not be used."""
    return WRONG_RESULT if verdict.level is Level.WRONG else 0


def print_section(terminal: Terminal, section: "Section") -> None:
    """Print heading, notes and table of a section; rows with a warning are red."""
    terminal.print(Text.assemble("\n", (section.heading, "bold"), "  ", (" ".join(section.notes), "dim")))
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
