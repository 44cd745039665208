"""A page of sections with text, tables and pictures, as one HTML file that fetches and runs nothing.

The reports of a body, of a recording and of a study are such pages; ``page.html.jinja`` is their one template.
"""

import base64
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from bodycam_ros.picture_style import FAINT, INK, QUIET, WARNING

_TEMPLATE = "page.html.jinja"


@dataclass(frozen=True)
class Link:
    """A cell that leads to another file.

    Attributes:
        text: that is shown.
        target: path from the folder of the page.
    """

    text: str
    target: str

    @property
    def href(self) -> str:
        """The target as a page writes it."""
        return quote(self.target)


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

    @property
    def base64(self) -> str:
        """The content as a page writes it."""
        return base64.b64encode(self.content).decode("ascii")


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


@dataclass(frozen=True)
class Page:
    """A title, paragraphs and sections, from top to bottom."""

    title: str
    lines: Sequence[str]
    sections: Sequence[Section]


def render_page(page: Page) -> str:
    """The page as an HTML 5 document."""
    environment = Environment(
        loader=FileSystemLoader(Path(__file__).parent),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        undefined=StrictUndefined,
    )
    colours = {"ink": INK, "quiet": QUIET, "faint": FAINT, "warning": WARNING}
    return environment.get_template(_TEMPLATE).render(page=page, **colours)


def number(value: float | None, decimals: int = 2, signed: bool = False) -> str:
    """A number as a cell shows it; empty where it is unknown."""
    if value is None or value != value:
        return ""
    text = f"{value:{'+' if signed else ''}.{decimals}f}"
    return text if float(text) else text.lstrip("+-")
