"""Colours and typography of all pictures."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

import matplotlib
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure

LEFT, RIGHT, CENTRE = "#1f6fb4", "#dd7a12", "#33383d"
"""Sides of the body: blue and orange stay apart for every eye."""

TRUTH = "#a9b0b7"
WARNING = "#c8102e"
"""Lost cameras, gaps, frames without any camera, a result that is wrong; nothing else is red."""

CAUTION, GOOD = "#9a6700", "#2c7f78"
"""A result that is doubtful, and one that is good."""

RELATIVE, ROTATION_ONLY = "#7a6cb4", "#d9b13b"
"""A camera registered by extended landmarks, and one of which only the rotation is known."""

EQUIPMENT = "#8e4a8a"
"""Equipment, drawn thinner than limbs."""

INK, QUIET, FAINT = "#22272b", "#6b747c", "#e3e7ea"

LANDMARKS = LinearSegmentedColormap.from_list("landmarks", ["#e4f0ee", "#7fb9b0", "#2c7f78", "#0c4644"])

TYPOGRAPHY: Any = {
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 9.0,
    "text.color": INK,
    "text.parse_math": False,
    "axes.labelcolor": QUIET,
    "axes.edgecolor": QUIET,
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "xtick.color": QUIET,
    "ytick.color": QUIET,
    "xtick.labelsize": 8.0,
    "ytick.labelsize": 8.0,
    "legend.frameon": False,
    "legend.fontsize": 8.0,
}
_DOTS_PER_INCH = 110


@contextmanager
def open_picture(file: Path | IO[bytes], width: float, height: float) -> Iterator[Figure]:
    """A white figure of a size [in], written as PNG at the end of the block.

    Raises:
        OSError: the file cannot be written.
    """
    with matplotlib.rc_context(TYPOGRAPHY):
        figure = Figure(figsize=(width, height), facecolor="white")
        yield figure
        figure.savefig(file, dpi=_DOTS_PER_INCH, format="png")


def rgb(colour: str) -> tuple[int, int, int]:
    """Red, green and blue, 0 to 255, of ``#rrggbb``."""
    red, green, blue = bytes.fromhex(colour.removeprefix("#"))
    return red, green, blue


def side_colour(segment: str) -> str:
    """Colour of the side that a segment's name ends with."""
    if segment.endswith("_left"):
        return LEFT
    return RIGHT if segment.endswith("_right") else CENTRE


def panel_title(axes: Axes, title: str, note: str = "") -> None:
    """A title above the left end of a panel, and a quiet note after it."""
    offset: Any = {"textcoords": "offset points"}
    text = axes.annotate(
        title, (0.0, 1.0), (0.0, 7.0), xycoords="axes fraction", weight="bold", fontsize=10.0, **offset
    )
    if note:
        axes.annotate(note, (1.0, 0.0), (8.0, 0.0), xycoords=text, color=QUIET, fontsize=8.5, va="bottom", **offset)


def name_rows(axes: Axes, names: Sequence[str]) -> None:
    """Name the rows of a panel without a frame by cameras, each in the colour of its side."""
    axes.set_yticks(range(len(names)), [name.replace("_", " ") for name in names])
    for label, name in zip(axes.get_yticklabels(), names, strict=True):
        label.set_color(side_colour(name))
    axes.spines[:].set_visible(False)


def light_grid(axes: Axes) -> None:
    """Lines across at the ticks of the value axis, behind everything."""
    axes.grid(axis="y", color=FAINT, linewidth=0.7)
    axes.set_axisbelow(True)
    axes.tick_params(length=2.5, width=0.6)
