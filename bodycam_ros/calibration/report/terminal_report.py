"""A calibration's diagnosis on a terminal: tables that fit a hundred columns, and what to look at last."""

from typing import Literal

from rich.box import SIMPLE_HEAD
from rich.console import Console, Group, RenderableType
from rich.table import Table
from rich.text import Text

from bodycam_ros.calibration.diagnosis import CalibrationDiagnosis
from bodycam_ros.calibration.report.report_tables import ReportTable, report_tables, summary_line
from bodycam_ros.terminal import Terminal

WIDTH = 100
"""Columns that a report needs, and has where it goes to a file or pipe whose width nobody knows."""

_LIST_WIDTH = 27
"""Columns of a list at the end of a row; it takes several lines before a figure does."""

_LOOK_HERE = "bold red"


def print_report(diagnosis: CalibrationDiagnosis, console: Console | None = None) -> None:
    """Print the tables of a diagnosis, then its warnings; rows that a warning speaks of are red."""
    console = console or Terminal()
    if not console.is_terminal:
        console.width = max(console.width, WIDTH)
    for part in terminal_report(diagnosis).renderables:
        console.print(part)


def terminal_report(diagnosis: CalibrationDiagnosis) -> Group:
    """What ``print_report`` prints."""
    parts: list[RenderableType] = [Text(summary_line(diagnosis))]
    for table in report_tables(diagnosis):
        parts += [Text(), Text.assemble((table.title, "bold"), "  ", (table.note, "dim")), _table(table)]
    return Group(*parts, *_warnings(diagnosis))


def _table(content: ReportTable) -> Table:
    table = Table(box=SIMPLE_HEAD, padding=(0, 1, 0, 0), pad_edge=False)
    for index, heading in enumerate(content.columns):
        justify: Literal["left", "right"] = "left" if index in content.text_columns else "right"
        # Text, not str: square brackets hold units here, not rich's markup. Folded, no letter is lost on any width.
        table.add_column(
            Text(heading.replace(" [", "\n[")),
            justify=justify,
            overflow="fold",
            max_width=_LIST_WIDTH if heading == content.columns[-1] else None,
        )
    for index, row in enumerate(content.rows):
        table.add_row(*map(Text, row), style=_LOOK_HERE if index in content.flagged else None)
    return table


def _warnings(diagnosis: CalibrationDiagnosis) -> list[RenderableType]:
    if not diagnosis.warnings:
        return [Text("no warnings", style="green")]
    listed = Table.grid(padding=(0, 1))
    for number, warning in enumerate(diagnosis.warnings, start=1):
        listed.add_row(Text(f"{number}.", style=_LOOK_HERE), Text(warning))
    return [Text("look at", style=_LOOK_HERE), listed]
