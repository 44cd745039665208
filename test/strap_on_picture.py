"""The picture of docs/strap_on.md: a body of capsules in the N-pose, and where the cameras of the sample sit on it."""

from collections.abc import Sequence
from io import BytesIO

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

from bodycam_ros.body.body_edit import n_pose
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.drawing.picture_style import GOOD, INK, QUIET, TYPOGRAPHY, panel_title
from bodycam_ros.geometry import Array, transform_points
from bodycam_ros.outside.capsules import capsule_surfaces

_SIZE_IN, _DOTS_PER_INCH = (11.0, 7.2), 110
_SKIN = "#d5dbe0"
_LOOK_M = 0.11  # how far ahead of a camera its mark points
_END_ON_M = 0.04  # a mark that looks shorter is seen from its end
_LABELS_M, _LABEL_STEP_M = 0.47, 0.085  # of their columns from the middle, and between two labels
_LIGHT = np.array([0.5, 0.2, 0.84])
_VIEWS = {"from the front": 1.0, "from behind": -1.0}


def strap_on_png(body: BodyModel) -> bytes:
    """The picture as a PNG file's content."""
    with matplotlib.rc_context(TYPOGRAPHY):
        figure = Figure(figsize=_SIZE_IN, dpi=_DOTS_PER_INCH, facecolor="white")
        FigureCanvasAgg(figure)
        poses = n_pose(body, np.eye(4))
        for column, (title, towards) in enumerate(_VIEWS.items(), start=1):
            axes = figure.add_subplot(1, 2, column)
            _draw_skin(axes, body, poses, towards)
            _draw_cameras(axes, body, poses, towards)
            panel_title(axes, title, "its left is on the right" if towards > 0.0 else "its left is on the left")
            axes.set_aspect("equal")
            axes.set_xlim(-0.78, 0.78)
            axes.axis("off")
        figure.subplots_adjust(0.01, 0.01, 0.99, 0.94, 0.02)
        content = BytesIO()
        figure.savefig(content, format="png")
    return content.getvalue()


def _on_screen(points: Array, towards: float) -> Array:
    """Across and up (..., 2) [m]; the viewer stands where x is large, or where it is small."""
    screen: Array = np.stack([towards * points[..., 1], points[..., 2]], axis=-1)
    return screen


def _draw_skin(axes: Axes, body: BodyModel, poses: Array, towards: float) -> None:
    triangles = []
    for segment, surface in capsule_surfaces(body).items():
        points = transform_points(poses[body.segment_index[segment]], surface.vertices)
        triangles.append(points[surface.faces])
    corners = np.concatenate(triangles)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    order = np.argsort(towards * corners[..., 0].mean(axis=1))
    light = _LIGHT * np.array([towards, towards, 1.0])
    shade = (0.82 + 0.18 * np.clip(normals[order] @ light, 0.0, 1.0))[:, None]
    colours = np.clip(np.array(to_rgb(_SKIN)) * shade, 0.0, 1.0)
    outlines = list(_on_screen(corners[order], towards))
    axes.add_collection(PolyCollection(outlines, facecolors=colours, edgecolors=colours, linewidths=0.4))
    axes.set_ylim(corners[..., 2].min() - 0.05, corners[..., 2].max() + 0.05)


def _draw_cameras(axes: Axes, body: BodyModel, poses: Array, towards: float) -> None:
    """A mark and where it looks; named are those that this viewer sees."""
    placed = {name: poses[body.segment_index[m.segment]] @ m.segment_T_camera for name, m in body.mounts.items()}
    shown = {name: pose for name, pose in placed.items() if (pose[0, 2] < -0.5) == (towards < 0.0)}
    for pose in shown.values():
        place, end = _on_screen(np.stack([pose[:3, 3], pose[:3, 3] + _LOOK_M * pose[:3, 2]]), towards)
        axes.plot(*place, "s", color=GOOD, markersize=7.0, zorder=4)
        if np.linalg.norm(end - place) > _END_ON_M:
            axes.annotate("", end, place, arrowprops={"arrowstyle": "->", "color": INK, "linewidth": 1.2}, zorder=5)
        else:
            axes.plot(*place, "o", color="white", markersize=2.8, zorder=5)  # looks at the viewer
    for side in (-1.0, 1.0):
        column = {name: _on_screen(pose[:3, 3], towards) for name, pose in shown.items()}
        names = sorted((n for n in column if (column[n][0] > 0.0) == (side > 0.0)), key=lambda n: column[n][1])
        for name, height in zip(names, _apart([float(column[n][1]) for n in names]), strict=True):
            axes.annotate(
                name, column[name], (side * _LABELS_M, height), ha="left" if side > 0.0 else "right", va="center",
                fontsize=9.5, color=INK, arrowprops={"arrowstyle": "-", "color": QUIET, "linewidth": 0.6}, zorder=3,
            )  # fmt: skip


def _apart(heights: Sequence[float]) -> list[float]:
    """Rising heights, each at least a step above the one before, as a whole in the middle of where they were."""
    moved: list[float] = []
    for height in heights:
        moved.append(max(height, moved[-1] + _LABEL_STEP_M) if moved else height)
    shift = float(np.mean(np.subtract(heights, moved))) if moved else 0.0
    return [height + shift for height in moved]
