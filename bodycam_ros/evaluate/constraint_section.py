"""With and without constraints: close-ups (B figure 9), and distances from where equipment holds (B figure 12)."""

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from bodycam_ros.evaluate.agreement import Spread
from bodycam_ros.evaluate.close_ups import COLUMNS, CloseUp
from bodycam_ros.evaluate.comparison import Comparison
from bodycam_ros.evaluate.held_points import HeldPoint, WithAndWithout
from bodycam_ros.evaluate.page import Block, Heading, Picture, Table, Text, number
from bodycam_ros.geometry import Array
from bodycam_ros.plots.picture_style import CAUTION, INK, QUIET, TYPOGRAPHY, light_grid, panel_title
from bodycam_ros.results.solved_recording import GAP_FRAMES

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


CONSTRAINTS, HELD_WAYS = "constraints.png", "held_ways.png"
"""Files of the section's pictures."""


def constraint_section(both: WithAndWithout) -> tuple[Block, ...]:
    """What is said of both motions."""
    assert both.solved.equipment is not None
    rows = [
        (name, *(number(getattr(of, key)) for of in spreads for key in ("mean", "median", "max")))
        for name, spreads in _rows(both).items()
    ]
    return (
        Heading(f"With and without {both.solved.equipment.name}"),
        Text(
            f"{both.solved.path.name} beside {both.other.path.name}, at {len(both.stamps_ns)} instants. Distances are "
            "from where the equipment holds a point, which only the motion with it knows, to where each motion has it."
        ),
        Table(("", "with: mean", "median", "max", "without: mean", "median", "max"), rows),
        Picture(
            CONSTRAINTS,
            "With the constraints and without them (after B figures 9 and 12). A ring is where the equipment holds a "
            "point, a dot where the body has it; below, the distance between the two.",
        ),
        Picture(HELD_WAYS, "Ways of what is held, with the constraints and without them (B figure 10)."),
    )


def constraint_figures(both: WithAndWithout) -> dict[str, Any]:
    """Figures by name, the unit at the end of the name."""
    return {
        "with": both.solved.path.name,
        "without": both.other.path.name,
        "instants": len(both.stamps_ns),
        "measures": {
            name: {"with": asdict(spreads[0]), "without": asdict(spreads[1])} for name, spreads in _rows(both).items()
        },
    }


def _rows(both: WithAndWithout) -> dict[str, tuple[Spread, Spread]]:
    """Measure -> with and without."""
    rows: dict[str, tuple[Array, Array]] = {
        f"{point.name.replace('_', ' ')} [mm]": (1e3 * point.off_with, 1e3 * point.off_without) for point in both.points
    }
    if both.true_with is not None and both.true_without is not None:
        ours, other = both.true_with, both.true_without
        rows["joints against the truth [cm]"] = (100.0 * ours.position_errors, 100.0 * other.position_errors)
        rows["angles against the truth [deg]"] = (_angles_deg(ours), _angles_deg(other))
    return {name: (Spread.of(a), Spread.of(b)) for name, (a, b) in rows.items()}


def _angles_deg(comparison: Comparison) -> Array:
    angles: Array = np.degrees(np.array([joint.angle_errors for joint in comparison.joints.values()]))
    return angles
