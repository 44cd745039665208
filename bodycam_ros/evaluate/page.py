"""A page of headings, text, tables and pictures, whatever it will be written as."""

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Heading:
    """Of a section."""

    text: str


@dataclass(frozen=True)
class Text:
    """A paragraph."""

    text: str


@dataclass(frozen=True)
class Link:
    """A cell that leads to another file.

    Attributes:
        text: that is shown.
        target: path from the folder of the page on.
    """

    text: str
    target: str


@dataclass(frozen=True)
class Table:
    """Cells as they are shown; the first column is of names, all others are of numbers.

    Attributes:
        columns: headings.
        rows: as many cells each.
    """

    columns: Sequence[str]
    rows: Sequence[Sequence[str | Link]]


@dataclass(frozen=True)
class Picture:
    """A file in the folder of the page.

    Attributes:
        file: name.
        caption: what it shows.
    """

    file: str
    caption: str


Block = Heading | Text | Table | Picture


@dataclass(frozen=True)
class Page:
    """What is on a page, from top to bottom."""

    title: str
    blocks: tuple[Block, ...]


def number(value: float | None, decimals: int = 2, signed: bool = False) -> str:
    """A number as a cell shows it; empty where it is not known."""
    if value is None or value != value:
        return ""
    text = f"{value:{'+' if signed else ''}.{decimals}f}"
    return text if float(text) else text.lstrip("+-")
