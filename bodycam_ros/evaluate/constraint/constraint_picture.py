"""With and without constraints: close-ups (B figure 9), and distances from where equipment holds (B figure 12)."""

from collections.abc import Sequence
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from bodycam_ros.drawing.picture_style import CAUTION, INK, QUIET, TYPOGRAPHY, light_grid, panel_title
from bodycam_ros.evaluate.constraint.close_ups import COLUMNS, CloseUp
from bodycam_ros.evaluate.constraint.held_points import HeldPoint, WithAndWithout
from bodycam_ros.geometry import Array
from bodycam_ros.solved.solved_recording import GAP_FRAMES

_WIDTH_INCHES, _CURVES_INCHES, _TITLE_INCHES = 14.0, 2.6, 0.45
_DOTS_PER_INCH = 110
_CURVES = 3
"""That are beside each other at most."""

WITH, WITHOUT = INK, CAUTION
"""Colours of the two motions."""


def draw_constraints(both: WithAndWithout, shown: Sequence[CloseUp], path: Path) -> None:
    """Write the picture as PNG.

    Raises:
        OSError: the file cannot be written.
    """
    points = both.firm[:_CURVES]
    side = _WIDTH_INCHES / COLUMNS
    rows = [side + _TITLE_INCHES] * 2 if shown else []
    height = sum(rows) + _CURVES_INCHES + 1.2
    with matplotlib.rc_context(TYPOGRAPHY):
        figure = Figure(figsize=(_WIDTH_INCHES, height), facecolor="white")
        FigureCanvasAgg(figure)
        for column, close_up in enumerate(shown):
            for row, (picture, name, off) in enumerate(
                zip((close_up.with_it, close_up.without), ("with", "without"), close_up.off_mm, strict=True)
            ):
                bottom = 1.0 - (row + 1) * (side + _TITLE_INCHES) / height
                place = (column / COLUMNS + 0.004, bottom, 1.0 / COLUMNS - 0.008, side / height)
                axes = figure.add_axes(place)
                axes.imshow(picture[..., ::-1], interpolation="lanczos")
                axes.axis("off")
                panel_title(axes, name, f"{close_up.station}, {close_up.seconds:.2f} s, {off:.0f} mm off")
        if shown:
            note = "ring: where the equipment holds a point; dot: where the body has it"
            figure.text(0.995, (_CURVES_INCHES + 1.1) / height, note, ha="right", color=QUIET)
        for number, point in enumerate(points):
            width = 0.945 / len(points)
            place = (0.05 + number * width, 0.55 / height, width - 0.05, _CURVES_INCHES / height)
            _draw_curves(figure.add_axes(place), both, point)
        figure.savefig(path, dpi=_DOTS_PER_INCH, format="png")


def _draw_curves(axes: Axes, both: WithAndWithout, point: HeldPoint) -> None:
    for off, colour, name in ((point.off_without, WITHOUT, "without"), (point.off_with, WITH, "with")):
        seconds, values = _curve(both, 1e3 * off)
        label = f"{name}: {1e3 * float(off.mean()):.1f} mm, {1e3 * float(off.max()):.1f} at most"
        axes.plot(seconds, values, color=colour, linewidth=1.4, label=label)
    axes.set_ylim(0.0, 1.35e3 * float(max(point.off_without.max(), point.off_with.max())))
    axes.set_xlabel("time [s]")
    axes.set_ylabel("distance [mm]")
    axes.legend(loc="upper right", ncols=2, labelcolor=QUIET)
    light_grid(axes)
    panel_title(axes, point.name.replace("_", " "), "from where the equipment holds it")


def _curve(both: WithAndWithout, values: Array) -> tuple[Array, Array]:
    solved = both.solved
    after = np.flatnonzero(np.diff(both.stamps_ns) > GAP_FRAMES * max(solved.frame_ns, solved.instant_ns)) + 1
    return np.insert(solved.seconds(both.stamps_ns), after, np.nan), np.insert(values, after, np.nan)
