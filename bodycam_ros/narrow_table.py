"""Tables on a terminal that is too narrow for them: headings give way, then frames; figures and names stay whole."""

from collections.abc import Sequence
from copy import copy

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Column, Table
from rich.text import Text

_ANY_WIDTH = 10_000

_PARTED = {
    "registered": ("regis-", "tered"),
    "landmarks": ("land-", "marks"),
    "difference": ("differ-", "ence"),
    "confidence": ("confi-", "dence"),
    "photograph": ("photo-", "graph"),
    "photographs": ("photo-", "graphs"),
    "exercised": ("exer-", "cised"),
    "expected": ("expec-", "ted"),
}
"""Where long words of headings are parted."""


def fitted(table: Table, console: Console) -> Table:
    """The table, or a narrower one that says the same, if it is wider than the console."""
    if _width(table, console) <= console.width:
        return table
    narrow = copy(table)
    narrow.box, narrow.padding, narrow.pad_edge = SIMPLE_HEAD, (0, 1, 0, 0), False
    narrow.columns = [_narrowed(column) for column in table.columns]
    if _width(narrow, console) > console.width:
        narrow.padding, narrow.show_edge = 0, False
    return narrow


def _width(table: Table, console: Console) -> int:
    """That a table would like to have."""
    return table.__rich_measure__(console, console.options.update(max_width=_ANY_WIDTH)).maximum


def _narrowed(column: Column) -> Column:
    """The same with a heading of several lines; without a break in its cells unless they have several words."""
    narrow = copy(column)
    cells = [str(cell) for cell in column.cells]
    widest = max((len(line) for cell in cells for line in cell.split("\n")), default=0)
    narrow.header = Text("\n".join(_lines(str(column.header), widest)))
    narrow.no_wrap = column.no_wrap or not any(" " in cell.strip() for cell in cells)
    return narrow


def _lines(heading: str, width: int) -> Sequence[str]:
    """The words of a heading in lines that are as long as the cells below, or as its longest word."""
    words: list[str] = []
    for word in heading.split():
        words += _PARTED.get(word, (word,)) if len(word) > width else (word,)
    width = max([width, *map(len, words)])
    lines = [""]
    for word in words:
        joined = f"{lines[-1]} {word}".lstrip()
        if len(joined) <= width and not lines[-1].endswith("-"):
            lines[-1] = joined
        else:
            lines.append(word)
    return lines
