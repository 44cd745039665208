"""Reports as sections of text, tables and pictures, for the terminal and for pages alike.

A page is one HTML file that fetches and runs nothing, made by the template ``page.html.jinja``.
"""

import base64
from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bodycam_ros.results.colours import FAINT, INK, QUIET, WARNING

Columns = Sequence[tuple[str, str, str] | tuple[str, str, str, float]]
"""Heading, path of the figure ("position_gap_mm.median"), format of each column, and a factor to the heading's unit."""


@dataclass(frozen=True)
class Link:
    """A cell that leads to another file.

    Attributes:
        text: that is shown.
        target: path from the folder of the page.
    """

    text: str
    target: str


@dataclass(frozen=True)
class Table:
    """Cells as text.

    Attributes:
        columns: headings, with units.
        rows: a cell for each column; empty where a figure is unknown.
        text_columns: indices of columns of words, set flush left; all others are of numbers.
        flagged: indices of rows with a warning.
    """

    columns: Sequence[str]
    rows: Sequence[Sequence[str | Link]]
    text_columns: frozenset[int] = frozenset({0})
    flagged: frozenset[int] = frozenset()


@dataclass(frozen=True)
class Picture:
    """A PNG file.

    Attributes:
        content: of the file.
        caption: what it shows.
    """

    content: bytes
    caption: str


@dataclass(frozen=True)
class Section:
    """A part of a page; what it has is shown in this order.

    Attributes:
        heading: empty for none.
        notes: paragraphs on how to read it.
        warnings: a numbered list, in red.
        table: None for none.
        pictures: one below the other.
    """

    heading: str = ""
    notes: Sequence[str] = ()
    warnings: Sequence[str] = ()
    table: Table | None = None
    pictures: Sequence[Picture] = ()


def column_table(
    title: str,
    heading: str,
    columns: Columns,
    rows: Mapping[str, object],
    note: str | Mapping[str, str] = "",
    flagged: Set[str] = frozenset(),
) -> Section:
    """A table with a row of figures per name; a column without any figure is left out.

    Args:
        title: of the section.
        heading: of the column with the names.
        columns: of the figures.
        rows: name -> figures, a mapping or an object with attributes; unknown ones are empty cells.
        note: how to read it; or heading without its unit -> what it means, of which those of the columns that are
            shown make the note.
        flagged: names of rows with a warning.
    """
    values = [[find_figure(row, column[1]) for row in rows.values()] for column in columns]
    cells = [[_cell(value, *column[2:]) for value in each] for each, column in zip(values, columns, strict=True)]
    shown = [index for index, column in enumerate(cells) if any(column)]
    words = (place for place, index in enumerate(shown, 1) if any(isinstance(value, str) for value in values[index]))
    table = Table(
        (heading, *(columns[index][0] for index in shown)),
        [(name, *(cells[index][row] for index in shown)) for row, name in enumerate(rows)],
        text_columns=frozenset((0, *words)),
        flagged=frozenset(row for row, name in enumerate(rows) if name in flagged),
    )
    if not isinstance(note, str):
        headings = {column.split(" [")[0] for column in table.columns}
        note = "; ".join(f"{name}: {meaning}" for name, meaning in note.items() if name in headings)
    return Section(title, (note,) if note else (), table=table)


def find_figure(row: object, path: str) -> Any:
    """The figure at a path of names joined by dots, in mappings or objects; None where it is unknown."""
    for key in path.split("."):
        row = row.get(key) if isinstance(row, Mapping) else getattr(row, key, None)
    return row


def _cell(value: Any, form: str, factor: float = 1.0) -> str:
    """A figure as text; several of an array are apart."""
    if value is None or isinstance(value, str):
        return value or ""
    if not isinstance(value, int | float):
        return " ".join(_cell(each, form, factor) or "?" for each in value.tolist())
    text = f"{factor * value if factor != 1.0 else value:{form}}" if value == value else ""
    return text.lstrip("+-") if text and not text.strip("+-0.") else text


def render_page(title: str, lines: Sequence[str], sections: Sequence[Section]) -> str:
    """A page as an HTML 5 document: a title, paragraphs and sections, from top to bottom."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    environment = Environment(
        loader=FileSystemLoader(Path(__file__).parent),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        undefined=StrictUndefined,
    )
    environment.filters["base64"] = lambda content: base64.b64encode(content).decode("ascii")
    template = environment.get_template("page.html.jinja")
    return template.render(
        title=title, lines=lines, sections=sections, ink=INK, quiet=QUIET, faint=FAINT, warning=WARNING
    )
