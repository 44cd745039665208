"""What reaches a terminal: tables, progress and log lines, with what comes from files made harmless (``printable``)."""

import logging
from collections.abc import Iterable
from typing import Any

from rich.console import Console, ConsoleOptions, RenderableType
from rich.logging import RichHandler
from rich.segment import Segment
from rich.table import Table

from bodycam_ros.files.shown import printable

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
        """Print lines as they are, and tables no wider than the terminal."""
        has_table = any(isinstance(each, Table) for each in objects)
        super().print(*objects, **{"soft_wrap": not has_table, **options})

    def render(self, renderable: RenderableType, options: ConsoleOptions | None = None) -> Iterable[Segment]:
        """Text, style and control codes of a renderable."""
        for segment in super().render(renderable, options):
            text, style, control = segment
            yield segment if control else Segment(printable(text), style)


def log_to_terminal(verbose: bool) -> None:
    """Show warnings, with ``verbose`` everything, on stderr."""
    handler = RichHandler(console=Terminal(stderr=True), show_time=False, show_path=False, markup=False)
    logging.basicConfig(level=logging.DEBUG if verbose else logging.WARNING, format="%(message)s", handlers=[handler])
