"""Panel: the skeleton at some times, side by side, each seen from the same side of the pelvis."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Circle

from bodycam_ros.body.stick_figure import HEAD, Bone, limb_bones
from bodycam_ros.evaluate.evaluation import Evaluation
from bodycam_ros.geometry import Array
from bodycam_ros.picture_style import (
    CENTRE,
    EQUIPMENT,
    FAINT,
    INK,
    LEFT,
    QUIET,
    RIGHT,
    TRUTH,
    panel_title,
    side_colour,
)

_FIGURES = 8  # times that are shown, evenly spread
_STEP_M = 1.1  # between two figures on the screen
_HEAD_RADIUS_M = 0.10
_TURN, _ELEVATION = np.radians(35.0), np.radians(14.0)  # of the view, from the side towards the front, and from above
_RIGHT = np.array([np.cos(_TURN), np.sin(_TURN), 0.0])
_AWAY = np.array([-np.sin(_TURN), np.cos(_TURN), 0.0])
_UP = np.array([0.0, 0.0, np.cos(_ELEVATION)]) + np.sin(_ELEVATION) * _AWAY
_DEPTH = np.cross(_UP, _RIGHT)

_TRUTH_STYLE: Any = {"color": TRUTH, "linewidth": 5.5, "alpha": 0.55}


def draw_figures(axes: Axes, evaluation: Evaluation) -> None:
    """Draw the panel: left, right and centre in their colours, the truth in grey beneath."""
    solved, comparison = evaluation.solved, evaluation.comparison
    rows = np.unique(np.linspace(0, len(solved.stamps_ns) - 1, _FIGURES).round().astype(int)).tolist()
    body = solved.bones()
    truth = [] if comparison is None else limb_bones(comparison.true_segments, solved.parents)
    floor_z = min(float(np.minimum(b.start, b.end)[:, 2].min()) for b in body if not b.is_equipment)
    for number, row in enumerate(rows):
        world_T_root = solved.motion.world_T_root[row]
        ground = np.array([*world_T_root[:2, 3], floor_z])
        heading = np.arctan2(world_T_root[1, 0], world_T_root[0, 0])
        cosine, sine = np.cos(heading), np.sin(heading)
        level_R_world = np.array([[cosine, sine, 0.0], [-sine, cosine, 0.0], [0.0, 0.0, 1.0]])
        if comparison is not None:
            nearest = int(np.argmin(np.abs(comparison.stamps_ns - solved.stamps_ns[row])))
            for line, _ in (_projected(bone, nearest, ground, level_R_world, number) for bone in truth):
                axes.plot(*line.T, solid_capstyle="round", zorder=2, **_TRUTH_STYLE)
        shown = [bone for bone in body if solved.placed[row] or not bone.is_equipment]
        lines = [(*_projected(bone, row, ground, level_R_world, number), bone) for bone in shown]
        for line, _, bone in sorted(lines, key=lambda each: -each[1]):  # the far side first; nearer lines cover it
            _draw_bone(axes, bone, line)
        seconds = float(solved.seconds(solved.stamps_ns[[row]])[0])
        place = (_STEP_M * number, 0.0)
        axes.plot([place[0] - 0.3, place[0] + 0.3], [0.0, 0.0], color=FAINT, linewidth=0.8, zorder=0)
        axes.annotate(
            f"{seconds:.1f} s", place, (0, -13), textcoords="offset points", ha="center", va="top", fontsize=8.0,
            color=QUIET,
        )  # fmt: skip
    has_equipment = any(bone.is_equipment for bone in body) and bool(solved.placed[rows].any())
    _draw_key(axes, comparison is not None, has_equipment)
    axes.set_aspect("equal", adjustable="datalim")
    axes.axis("off")
    travelled = np.linalg.norm(np.diff(solved.motion.world_T_root[:, :2, 3], axis=0), axis=1).sum()
    panel_title(axes, "Skeleton", f"side by side; the root travels {travelled:.1f} m")


def _projected(bone: Bone, row: int, ground: Array, level_R_world: Array, number: int) -> tuple[Array, float]:
    """Ends (2, 2) of a line on the screen [m] of one of the figures, and its depth."""
    ends = (np.stack([bone.start[row], bone.end[row]]) - ground) @ level_R_world.T
    screen = np.stack([ends @ _RIGHT + _STEP_M * number, ends @ _UP], axis=1)
    return screen, float((ends @ _DEPTH).sum())


def _draw_bone(axes: Axes, bone: Bone, line: Array) -> None:
    if bone.is_equipment:
        axes.plot(*line.T, color=EQUIPMENT, linewidth=1.2, solid_capstyle="round", zorder=3)
        return
    colour = side_colour(bone.segment)
    if bone.segment == HEAD:
        head = Circle(line[1], _HEAD_RADIUS_M, facecolor="white", edgecolor=colour, linewidth=1.8, zorder=3.1)
        axes.add_patch(head)
    axes.plot(*line.T, color=colour, linewidth=2.4, solid_capstyle="round", zorder=3)
    axes.plot(*line[0], "o", color=colour, markersize=3.6, zorder=3)


def _draw_key(axes: Axes, with_truth: bool, with_equipment: bool) -> None:
    entries: list[tuple[str, Any]] = [
        (name, {"color": colour, "linewidth": 2.4})
        for name, colour in (("left", LEFT), ("right", RIGHT), ("centre", CENTRE))
    ]
    entries += [("equipment", {"color": EQUIPMENT, "linewidth": 1.2})] if with_equipment else []
    entries += [("truth", _TRUTH_STYLE)] if with_truth else []
    handles = [Line2D([], [], label=name, **style) for name, style in entries]
    axes.legend(
        handles=handles, loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=len(handles), labelcolor=INK,
        handlelength=1.6, borderaxespad=0.0,
    )  # fmt: skip
