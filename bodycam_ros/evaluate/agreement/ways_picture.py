"""Ways through the world, ours over theirs (A figure 6): of cameras, alone and held by the body, or of joints."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from bodycam_ros.body.urdf import CAMERA_SUFFIX, optical_frame
from bodycam_ros.drawing.picture_style import CENTRE, LEFT, QUIET, RIGHT, TRUTH, TYPOGRAPHY, side_colour
from bodycam_ros.evaluate.agreement.agreement import Agreement, PointAgreement
from bodycam_ros.evaluate.agreement.agreement_figures import CM_PER_M
from bodycam_ros.evaluate.space_axes import frame_space
from bodycam_ros.geometry import Array
from bodycam_ros.solved.solved_recording import SolvedRecording

_SHOWN = ("torso", "head", "forearm_left", "forearm_right", "foot_left", "foot_right", "pelvis")
"""Of joints: all of them would hide each other."""

_WIDTH_INCHES, _PANEL_INCHES = 14.0, 6.8
_LOW_INCHES = 3.6
"""Height where ways are much longer than high, as when somebody walks; a cube needs all of a panel."""

_TITLE_INCHES = 0.7
_DOTS_PER_INCH = 110
_TURNS_DEG = (60.0, -30.0)


@dataclass(frozen=True, eq=False)
class _Panel:
    """Ways that are drawn together.

    Attributes:
        title, note: above it.
        ours: (segment for the colour, stamps (K,), way (K, 3)).
        turn_deg: by how much the view is turned from ahead.
    """

    title: str
    note: str
    ours: list[tuple[str, NDArray[np.int64], Array]]
    turn_deg: float


def draw_ways(solved: SolvedRecording, agreement: Agreement, path: Path) -> None:
    """Write the picture as PNG.

    Raises:
        OSError: the file cannot be written.
    """
    cameras = cameras_shown(solved, agreement)
    shown = cameras or _of_joints(agreement)
    panels = _camera_panels(solved, agreement, cameras) if cameras else _joint_panels(agreement, shown)
    theirs = [point.theirs for point in shown]
    every = np.concatenate([*theirs, *(point.ours for point in shown)])
    forward = agreement.points[0].body_R_world[:, 0, :2].mean(axis=0)
    ahead_deg = float(np.degrees(np.arctan2(forward[1], forward[0])))
    with matplotlib.rc_context(TYPOGRAPHY):
        extent = np.nanmax(every, axis=0) - np.nanmin(every, axis=0)
        share = min(1.0, 1.3 * float(extent[2] / max(np.linalg.norm(extent[:2]), 1e-3)))
        height = _TITLE_INCHES + _LOW_INCHES + (_PANEL_INCHES - _LOW_INCHES) * share
        figure = Figure(figsize=(_WIDTH_INCHES, height), facecolor="white")
        FigureCanvasAgg(figure)
        for number, panel in enumerate(panels):
            # Axes are square; what is empty of them lies outside of the picture.
            bottom = (height - _TITLE_INCHES - _PANEL_INCHES) / 2.0 / height
            place = (0.01 + 0.5 * number, bottom, 0.48, _PANEL_INCHES / height)
            axes: Any = figure.add_axes(place, projection="3d")
            frame_space(axes, every, ahead_deg - panel.turn_deg, "m", zoom=0.88)
            for way in theirs:
                axes.plot(*way.T, color=TRUTH, linewidth=3.0, alpha=0.75)
            for segment, stamps_ns, way in panel.ours:
                axes.plot(*_broken(solved, stamps_ns, way).T, color=side_colour(segment), linewidth=1.0)
            figure.text(0.03 + 0.5 * number, 1.0 - 0.35 / height, panel.title, fontsize=12.0, weight="bold")
            figure.text(0.03 + 0.5 * number, 1.0 - 0.58 / height, panel.note, color=QUIET)
        handles = [
            Line2D([], [], color=colour, label=name)
            for name, colour in (("left", LEFT), ("right", RIGHT), ("trunk", CENTRE))
        ]
        handles.append(Line2D([], [], color=TRUTH, linewidth=3.0, alpha=0.75, label=agreement.name))
        figure.legend(handles=handles, loc="upper right", bbox_to_anchor=(0.99, 1.0), ncols=2)
        figure.savefig(path, dpi=_DOTS_PER_INCH, format="png")


def cameras_shown(solved: SolvedRecording, agreement: Agreement) -> tuple[PointAgreement, ...]:
    """The cameras that the other system captured and that found themselves; a body may carry cameras without images."""
    there = {optical_frame(record.camera) for record in solved.cameras if record.registered.any()}
    return tuple(camera for camera in agreement.cameras if camera.link in there)


def _camera_panels(solved: SolvedRecording, agreement: Agreement, cameras: tuple[PointAgreement, ...]) -> list[_Panel]:
    records = {optical_frame(record.camera): record for record in solved.cameras}
    found, held, errors = [], [], []
    for point in cameras:
        record = records[point.link]
        held.append((_side_of(point), agreement.stamps_ns, point.ours))
        way = agreement.scale_used * record.world_T_camera[:, :3, 3] @ agreement.theirs_R_ours.T
        way = way + agreement.theirs_t_ours
        found.append((_side_of(point), record.stamps_ns, way))
        _, mine, other = np.intersect1d(record.stamps_ns, agreement.stamps_ns, return_indices=True)
        errors.append(np.linalg.norm(way[mine] - point.theirs[other], axis=1))
    solved_errors = np.array([point.errors for point in cameras])
    return [
        _Panel("Each camera by its own images", _note(np.concatenate(errors)), found, _TURNS_DEG[0]),
        _Panel("As the body holds them", _note(solved_errors), held, _TURNS_DEG[0]),
    ]


def _joint_panels(agreement: Agreement, shown: tuple[PointAgreement, ...]) -> list[_Panel]:
    ways = [(point.link, agreement.stamps_ns, point.ours) for point in shown]
    note = "of all joints: " + _note(agreement.position_errors)
    return [
        _Panel(f"Joints, {name}", note, ways, turn_deg)
        for name, turn_deg in zip(("from ahead and the right", "from ahead and the left"), _TURNS_DEG, strict=True)
    ]


def _of_joints(agreement: Agreement) -> tuple[PointAgreement, ...]:
    """The points whose ways are told apart: the first of each segment."""
    first = {point.link: point for point in reversed(agreement.joints)}
    return tuple(first[link] for link in _SHOWN if link in first) or agreement.joints


def _side_of(camera: PointAgreement) -> str:
    return camera.link.removesuffix(CAMERA_SUFFIX)


def _note(errors: Array) -> str:
    known = CM_PER_M * errors[np.isfinite(errors)]
    return f"{known.mean():.2f} cm off on average, {known.max():.2f} cm at most" if known.size else "never seen"


def _broken(solved: SolvedRecording, stamps_ns: NDArray[np.int64], way: Array) -> Array:
    """A way (K, 3) with a NaN in each gap of time."""
    after = np.flatnonzero(np.diff(stamps_ns) > solved.longest_step_ns) + 1
    return np.insert(way, after, np.nan, axis=0)
