"""Panel: the skeleton at some instants, walking over the floor."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Circle
from numpy.typing import NDArray

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

FIGURES = 8
"""Instants that are shown."""

_LEAST_STEP_M = 0.45
"""Figures nearer to each other than this on the screen would hide each other: they are drawn side by side."""

_SIDE_BY_SIDE_M = 0.85
_MARGIN_M = 0.7
_HEAD_RADIUS_M = 0.10


_TURN_WALKING = np.radians(20.0)  # from the side towards the front: both legs and arms stay apart
_TURN_STANDING = np.radians(50.0)  # of a person who stays in place
_ELEVATION = np.radians(14.0)  # enough to see the path on the floor
_STANDING_M = 1.5  # a root that moves less stands: the view follows its heading


@dataclass(frozen=True, eq=False)
class ObliqueView:
    """Screen axes in a world whose z is up.

    Attributes:
        right: (3,) unit vector to the right.
        up: (3,) unit vector upwards on the screen.
    """

    right: Array
    up: Array

    @classmethod
    def of_path(cls, world_T_root: Array) -> "ObliqueView":
        """The view of a root's path (T, 4, 4) [m], which goes to the right."""
        ground = world_T_root[:, :2, 3]
        centred = ground - ground.mean(axis=0)
        _, _, directions = np.linalg.svd(centred, full_matrices=False)
        along = centred @ directions[0]
        heading = directions[0] * (1.0 if along[-1] >= along[0] else -1.0)
        turn = _TURN_WALKING
        if np.ptp(along) < _STANDING_M:
            heading, turn = world_T_root[:, :2, 0].mean(axis=0), _TURN_STANDING
        azimuth = np.arctan2(heading[1], heading[0]) + turn
        right = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
        away = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
        return cls(right, np.sin(_ELEVATION) * away + np.cos(_ELEVATION) * np.array([0.0, 0.0, 1.0]))

    def project(self, points: Array) -> Array:
        """Screen positions (..., 2) [m] of points (..., 3) [m]."""
        screen: Array = np.stack([points @ self.right, points @ self.up], axis=-1)
        return screen

    def depth(self, points: Array) -> Array:
        """How far (...) points (..., 3) are from the viewer [m], up to a constant."""
        depth: Array = points @ np.cross(self.up, self.right)
        return depth


@dataclass(frozen=True, eq=False)
class _Scene:
    """What all layers of the panel share.

    Attributes:
        view: from where.
        rows: (F,) instants shown.
        placed: (T,) whether equipment is drawn at an instant.
        shifts: (F, 2) on the screen [m]; zero unless drawn side by side.
        floor_z: height of the floor [m].
    """

    view: ObliqueView
    rows: NDArray[np.int64]
    placed: NDArray[np.bool_]
    shifts: Array
    floor_z: float

    @property
    def apart(self) -> bool:
        return bool(self.shifts.any())


def draw_figures(axes: Axes, evaluation: Evaluation) -> None:
    """Draw the panel: left, right and centre in their colours, the truth in grey beneath."""
    solved = evaluation.solved
    body = solved.bones()
    root = solved.motion.world_T_root[:, :3, 3]
    scene = _scene(solved.motion.world_T_root, body, solved.placed)
    _draw_floor(axes, scene, root)
    if evaluation.comparison is not None:
        known = dict(zip(evaluation.comparison.segments, evaluation.comparison.true_segments, strict=True))
        rows = np.searchsorted(evaluation.comparison.stamps_ns, solved.stamps_ns[scene.rows])
        rows = np.minimum(rows, len(evaluation.comparison.stamps_ns) - 1)
        _draw_truth(axes, scene, limb_bones(known, solved.parents), rows)
    depth = scene.view.depth(root[scene.rows])
    for number in np.argsort(-depth):
        _draw_body(axes, scene, body, int(number))
    _label_times(axes, scene, root, solved.seconds(solved.stamps_ns[scene.rows]))
    _draw_key(
        axes,
        evaluation.comparison is not None,
        any(bone.is_equipment for bone in body) and bool(solved.placed[scene.rows].any()),
    )
    axes.set_aspect("equal", adjustable="datalim")
    axes.axis("off")
    how = "drawn side by side" if scene.apart else "floor tiles of 1 m"
    panel_title(axes, "Skeleton", f"the root travels {_travelled(root)[-1]:.1f} m; {how}")


def _scene(world_T_root: Array, body: list[Bone], placed: NDArray[np.bool_]) -> _Scene:
    """Where they are if that leaves room for each, else side by side and evenly spread over time."""
    view = ObliqueView.of_path(world_T_root)
    root = world_T_root[:, :3, 3]
    ends = [np.minimum(bone.start, bone.end)[:, 2] for bone in body if not bone.is_equipment]
    lowest = min((float(heights.min()) for heights in ends), default=0.0)
    travelled = _travelled(root)
    after = np.searchsorted(travelled, np.linspace(0.0, travelled[-1], FIGURES)[:-1], side="right") - 1
    rows = np.unique(np.append(after, len(root) - 1))
    across = np.sort(root[rows] @ view.right)
    if len(root) == 1 or (len(rows) == FIGURES and np.diff(across).min() >= _LEAST_STEP_M):
        return _Scene(view, rows, placed, np.zeros((len(rows), 2)), lowest)
    rows = np.unique(np.linspace(0, len(root) - 1, FIGURES).round().astype(np.int64))
    ground = view.project(np.column_stack([root[rows, :2], np.full(len(rows), lowest)]))
    beside = np.column_stack([_SIDE_BY_SIDE_M * np.arange(len(rows)), np.zeros(len(rows))])
    return _Scene(view, rows, placed, beside - ground, lowest)


def _travelled(points: Array) -> Array:
    """(T,) length of the path over the floor until each of points (T, 3) [m]."""
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points[:, :2], axis=0), axis=1))])


def _draw_floor(axes: Axes, scene: _Scene, root: Array) -> None:
    """The root's path on the floor; tiles of a metre where figures stand where they are."""
    ground = root.copy()
    ground[:, 2] = scene.floor_z
    path = scene.view.project(ground)
    if not scene.apart:
        low, high = ground[:, :2].min(axis=0) - _MARGIN_M, ground[:, :2].max(axis=0) + _MARGIN_M
        for axis in (0, 1):
            for place in np.arange(np.ceil(low[axis]), high[axis]):
                ends = np.array([[*low, scene.floor_z], [*high, scene.floor_z]])
                ends[:, axis] = place
                axes.plot(*scene.view.project(ends).T, color=FAINT, linewidth=0.8, zorder=0)
    if not scene.apart:
        axes.plot(*path.T, color=QUIET, linewidth=1.0, zorder=1)
    elif np.ptp(path[:, 0]) < _SIDE_BY_SIDE_M:
        for shift in scene.shifts:
            axes.plot(*(path + shift).T, color=FAINT, linewidth=0.8, zorder=1)
    axes.plot(*(path[scene.rows] + scene.shifts).T, "o", color=QUIET, markersize=3.5, zorder=1)


def _draw_body(axes: Axes, scene: _Scene, body: list[Bone], number: int) -> None:
    row, shift = scene.rows[number], scene.shifts[number]
    # The far side first; what is nearer covers it.
    for bone in sorted(body, key=lambda b: -float(scene.view.depth(b.start[row] + b.end[row]))):
        if bone.is_equipment and not scene.placed[row]:
            continue
        line = scene.view.project(np.stack([bone.start[row], bone.end[row]])) + shift
        if bone.is_equipment:
            axes.plot(*line.T, color=EQUIPMENT, linewidth=1.2, solid_capstyle="round", zorder=3)
            continue
        colour = side_colour(bone.segment)
        if bone.segment == HEAD:
            axes.add_patch(_head(line, colour))
        axes.plot(*line.T, color=colour, linewidth=2.4, solid_capstyle="round", zorder=3)
        axes.plot(*line[0], "o", color=colour, markersize=3.6, zorder=3)


def _head(line: Array, colour: str) -> Circle:
    return Circle(line[1], _HEAD_RADIUS_M, facecolor="white", edgecolor=colour, linewidth=1.8, zorder=3.1)


def _draw_truth(axes: Axes, scene: _Scene, body: list[Bone], rows: NDArray[np.int64]) -> None:
    for row, shift in zip(rows, scene.shifts, strict=True):
        for bone in body:
            line = scene.view.project(np.stack([bone.start[row], bone.end[row]])) + shift
            axes.plot(*line.T, color=TRUTH, linewidth=5.5, solid_capstyle="round", zorder=2, alpha=0.55)


def _label_times(axes: Axes, scene: _Scene, root: Array, seconds: Array) -> None:
    ground = root[scene.rows].copy()
    ground[:, 2] = scene.floor_z
    for place, time in zip(scene.view.project(ground) + scene.shifts, seconds, strict=True):
        axes.annotate(
            f"{time:.1f} s",
            place,
            (0, -13),
            textcoords="offset points",
            ha="center",
            va="top",
            fontsize=8.0,
            color=QUIET,
        )


def _draw_key(axes: Axes, with_truth: bool, with_equipment: bool) -> None:
    entries: Mapping[str, tuple[str, float]] = {"left": (LEFT, 2.4), "right": (RIGHT, 2.4), "centre": (CENTRE, 2.4)}
    handles = [Line2D([], [], color=colour, linewidth=width, label=name) for name, (colour, width) in entries.items()]
    if with_equipment:
        handles.append(Line2D([], [], color=EQUIPMENT, linewidth=1.2, label="equipment"))
    if with_truth:
        handles.append(Line2D([], [], color=TRUTH, linewidth=5.5, alpha=0.55, label="truth"))
    handles.append(Line2D([], [], color=QUIET, linewidth=1.0, marker="o", markersize=3.5, label="root on the floor"))
    axes.legend(
        handles=handles,
        loc="lower right",
        bbox_to_anchor=(1.0, 1.0),
        ncols=len(handles),
        labelcolor=INK,
        handlelength=1.6,
        borderaxespad=0.0,
    )
