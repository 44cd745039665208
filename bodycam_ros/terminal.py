"""What reaches a terminal: tables, progress and log lines, with what comes from files made harmless (``printable``)."""

import logging
from collections.abc import Iterable
from copy import copy
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.console import Console, ConsoleOptions, RenderableType
from rich.logging import RichHandler
from rich.segment import Segment
from rich.table import Table
from rich.text import Text

from bodycam_ros.shown import printable

_ANY_WIDTH = 10_000
_NARROWEST = 128
"""Columns of what is written to a file or pipe, whose width is unknown."""


class Terminal(Console):
    """A console of rich that lets nothing but its own colours and cursor movements through to the terminal.

    Names of topics, cameras and segments come from files of anybody.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__(**{"markup": False, "highlight": False, "emoji": False, **options})
        if not self.is_terminal and "width" not in options:
            self.width = max(self.width, _NARROWEST)

    def print(self, *objects: Any, **options: Any) -> None:
        """Print lines as they are, and tables that are wider than the terminal narrower where they can be."""
        fitted = [self._fitted(each) if isinstance(each, Table) else each for each in objects]
        super().print(*fitted, **{"soft_wrap": not any(isinstance(each, Table) for each in fitted), **options})

    def _fitted(self, table: Table) -> Table:
        """The table; one that is too wide without frames, the words of a heading one below the other."""
        if table.__rich_measure__(self, self.options.update(max_width=_ANY_WIDTH)).maximum <= self.width:
            return table
        narrow = copy(table)
        narrow.box, narrow.padding, narrow.pad_edge = SIMPLE_HEAD, (0, 1, 0, 0), False
        narrow.columns = [copy(column) for column in table.columns]
        for column in narrow.columns:
            column.header = Text("\n".join(str(column.header).split()), overflow="fold")
            column.overflow = "fold"
        return narrow

    def render(self, renderable: RenderableType, options: ConsoleOptions | None = None) -> Iterable[Segment]:
        """Text, style and control codes of a renderable."""
        for segment in super().render(renderable, options):
            text, style, control = segment
            yield segment if control else Segment(printable(text), style)


def log_to_terminal(verbose: bool) -> None:
    """Show warnings, with ``verbose`` everything, on stderr."""
    handler = RichHandler(console=Terminal(stderr=True), show_time=False, show_path=False, markup=False)
    logging.basicConfig(level=logging.DEBUG if verbose else logging.WARNING, format="%(message)s", handlers=[handler])
