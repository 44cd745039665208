"""What reaches a terminal: tables, progress and log lines, with what comes from files made harmless (``printable``)."""

import logging
from collections.abc import Iterable
from typing import Any

from rich.console import Console, ConsoleOptions, RenderableType
from rich.logging import RichHandler
from rich.segment import Segment
from rich.table import Table

from bodycam_ros.narrow_table import fitted
from bodycam_ros.shown import printable


class Terminal(Console):
    """A console of rich that lets nothing but its own colours and cursor movements through to the terminal.

    Names of topics, cameras and segments come from files of anybody.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__(**{"markup": False, "highlight": False, "emoji": False, **options})

    def print(self, *objects: Any, **options: Any) -> None:
        """Print; tables that are wider than the terminal give way where they can."""
        super().print(*(fitted(each, self) if isinstance(each, Table) else each for each in objects), **options)

    def render(self, renderable: RenderableType, options: ConsoleOptions | None = None) -> Iterable[Segment]:
        """Text, style and control codes of a renderable."""
        for segment in super().render(renderable, options):
            text, style, control = segment
            yield segment if control else Segment(printable(text), style)


_NARROWEST = 128
"""Columns of a table that is written to a file or pipe, whose width nobody knows."""


def widened(console: Terminal) -> Terminal:
    """The console, with room for wide tables where it is no terminal."""
    if not console.is_terminal:
        console.width = max(console.width, _NARROWEST)
    return console


def log_to_terminal(verbose: bool) -> None:
    """Show warnings, with ``verbose`` everything, on stderr."""
    handler = RichHandler(console=Terminal(stderr=True), show_time=False, show_path=False, markup=False)
    logging.basicConfig(level=logging.DEBUG if verbose else logging.WARNING, format="%(message)s", handlers=[handler])
