"""Ways of the balls of both feet in space, from two sides, beside those of the true feet (B figure 10)."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from bodycam_ros.evaluate.evaluation import Evaluation
from bodycam_ros.evaluate.sliding import feet_of, sole_of
from bodycam_ros.evaluate.space_axes import frame_space
from bodycam_ros.evaluate.summary import MM_PER_M
from bodycam_ros.evaluate.time_panels import broken_at_gaps
from bodycam_ros.geometry import Array
from bodycam_ros.plots.picture_style import QUIET, TRUTH, TYPOGRAPHY, side_colour

_BALL = 1  # of heel and ball
_TURNS_DEG = {"from ahead and the right": 55.0, "from ahead and the left": -40.0}
"""View -> by how much less than ahead of the body it stands, clockwise from above."""

_SIZE_INCHES = (14.0, 7.0)
_DOTS_PER_INCH = 110


def has_feet(evaluation: Evaluation) -> bool:
    """Whether the body has a foot to draw."""
    return bool(feet_of(evaluation.solved))


def draw_feet(evaluation: Evaluation, path: Path) -> None:
    """Write the picture as PNG: the left and the right foot in their colours, the true ones in grey beneath.

    Raises:
        OSError: the file cannot be written.
    """
    ours, true = ways(evaluation), true_ways(evaluation)
    heading = evaluation.solved.motion.world_T_root[:, :2, 0].mean(axis=0)
    ahead_deg = float(np.degrees(np.arctan2(heading[1], heading[0])))
    every = np.concatenate([*ours.values(), *true.values()])
    with matplotlib.rc_context(TYPOGRAPHY):
        figure = Figure(figsize=_SIZE_INCHES, facecolor="white")
        FigureCanvasAgg(figure)
        for number, (name, turn_deg) in enumerate(_TURNS_DEG.items()):
            axes: Any = figure.add_axes((0.02 + 0.49 * number, 0.0, 0.46, 0.97), projection="3d")
            frame_space(axes, every, ahead_deg - turn_deg)
            for way in true.values():
                axes.plot(*way.T, color=TRUTH, linewidth=3.5, alpha=0.75)
            for foot, way in ours.items():
                axes.plot(*way.T, color=side_colour(foot), linewidth=1.3)
            axes.text2D(0.04, 0.9, name, transform=axes.transAxes, color=QUIET)
        figure.text(0.03, 0.95, "Balls of the feet", fontsize=12.0, weight="bold")
        figure.text(0.03, 0.915, _note(ours, true), color=QUIET)
        handles = [Line2D([], [], color=side_colour(foot), label=foot.replace("_", " ")) for foot in ours]
        if true:
            handles.append(Line2D([], [], color=TRUTH, linewidth=3.5, alpha=0.75, label="truth"))
        figure.legend(handles=handles, loc="upper right", bbox_to_anchor=(0.98, 0.98), ncols=len(handles))
        figure.savefig(path, dpi=_DOTS_PER_INCH, format="png")


def ways(evaluation: Evaluation) -> dict[str, Array]:
    """Foot -> the way (N, 3) of its ball in the world [mm]; a row of NaN in each gap."""
    solved = evaluation.solved
    return {
        foot: broken_at_gaps(
            solved, solved.stamps_ns, MM_PER_M * sole_of(solved, foot, solved.world_T_link[foot])[:, _BALL]
        )[1]
        for foot in feet_of(solved)
    }


def true_ways(evaluation: Evaluation) -> dict[str, Array]:
    """The same of the true feet, in the same world [mm]; empty without truth."""
    solved, comparison = evaluation.solved, evaluation.comparison
    if comparison is None:
        return {}
    known = dict(zip(comparison.segments, comparison.true_segments, strict=True))
    return {
        foot: broken_at_gaps(solved, comparison.stamps_ns, MM_PER_M * sole_of(solved, foot, known[foot])[:, _BALL])[1]
        for foot in feet_of(solved)
        if foot in known
    }


def _note(ours: Mapping[str, Array], true: Mapping[str, Array]) -> str:
    note = "in the world [mm]"
    both = [foot for foot in ours if foot in true and len(ours[foot]) == len(true[foot])]
    if both:
        off = np.concatenate([np.linalg.norm(ours[foot] - true[foot], axis=1) for foot in both])
        off = off[np.isfinite(off)]
        note += f"; {off.mean():.1f} mm from the truth on average, {off.max():.1f} mm at most"
    return note
