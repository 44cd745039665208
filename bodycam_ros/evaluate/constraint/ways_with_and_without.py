"""Ways of what equipment holds through space, with the constraint and without, beside each other (B figures 10, 12)."""

from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from bodycam_ros.drawing.picture_style import EQUIPMENT, QUIET, TYPOGRAPHY, side_colour
from bodycam_ros.evaluate.constraint.held_points import WithAndWithout
from bodycam_ros.evaluate.space_axes import frame_space

_SIZE_INCHES = (14.0, 7.0)
_DOTS_PER_INCH = 110
_TURN_DEG = 55.0


def draw_ways_with_and_without(both: WithAndWithout, path: Path) -> None:
    """Write the picture as PNG: ways of held points in colour, of what holds them beneath.

    Raises:
        OSError: the file cannot be written.
    """
    points = both.firm
    every = 1e3 * np.concatenate([way for point in points for way in (point.held_at, point.with_it, point.without)])
    heading = both.solved.motion.world_T_root[:, :2, 0].mean(axis=0)
    ahead_deg = float(np.degrees(np.arctan2(heading[1], heading[0])))
    with matplotlib.rc_context(TYPOGRAPHY):
        figure = Figure(figsize=_SIZE_INCHES, facecolor="white")
        FigureCanvasAgg(figure)
        for number, (name, whose) in enumerate((("with", "with_it"), ("without", "without"))):
            axes: Any = figure.add_axes((0.02 + 0.49 * number, 0.0, 0.46, 0.95), projection="3d")
            frame_space(axes, every, ahead_deg - _TURN_DEG)
            for point in points:
                axes.plot(*(1e3 * point.held_at).T, color=EQUIPMENT, linewidth=3.0, alpha=0.35)
                axes.plot(*(1e3 * getattr(point, whose)).T, color=side_colour(point.segment), linewidth=1.3)
            off = 1e3 * np.array([np.linalg.norm(getattr(point, whose) - point.held_at, axis=1) for point in points])
            figure.text(0.03 + 0.49 * number, 0.95, name, fontsize=12.0, weight="bold")
            note = f"{off.mean():.1f} mm from where the equipment holds them on average, {off.max():.1f} mm at most"
            figure.text(0.03 + 0.49 * number, 0.92, note, color=QUIET)
        sides = {point.segment: side_colour(point.segment) for point in points}
        handles = [Line2D([], [], color=colour, label=name.replace("_", " ")) for name, colour in sides.items()]
        handles.append(Line2D([], [], color=EQUIPMENT, linewidth=3.0, alpha=0.35, label="what holds them"))
        figure.legend(handles=handles, loc="lower center", ncols=len(handles))
        figure.savefig(path, dpi=_DOTS_PER_INCH, format="png")
