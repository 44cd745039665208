"""Typography and panels of all pictures by matplotlib."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

import matplotlib
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure

from bodycam_ros.results.colours import FAINT, INK, QUIET, side_colour

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
