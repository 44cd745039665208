"""How two systems agree about joint angles: difference over mean (Bland and Altman 1986), per joint and plane."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from bodycam_ros.body.urdf import CAMERA_SUFFIX, optical_frame
from bodycam_ros.calibration.anthropometry import JOINT_ABOVE
from bodycam_ros.evaluate.agree import CM_PER_M
from bodycam_ros.evaluate.agreement import Agreement, AngleAgreement, LimitsOfAgreement, PointAgreement
from bodycam_ros.evaluate.anatomical_angles import PLANES, kind_and_side, meaning
from bodycam_ros.evaluate.page import number
from bodycam_ros.evaluate.space_axes import frame_space
from bodycam_ros.geometry import Array
from bodycam_ros.plots.picture_style import (
    CENTRE,
    INK,
    LEFT,
    QUIET,
    RIGHT,
    TRUTH,
    TYPOGRAPHY,
    light_grid,
    panel_title,
    side_colour,
)
from bodycam_ros.results.solved_recording import GAP_FRAMES, SolvedRecording

_PANEL_INCHES = (2.7, 2.3)
_KEY_INCHES, _TITLE_INCHES = 0.75, 0.6
_DOTS_PER_INCH = 110
_MOST_DOTS = 1500
"""Of a joint; more are one blot."""

_LEAST_DEG = 0.05  # that an axis of differences spans to each side


def draw_bland_altman(agreement: Agreement, path: Path) -> None:
    """Write the picture as PNG: a row per plane, a column per kind of joint, both sides in one panel.

    Raises:
        OSError: the file cannot be written.
    """
    kinds = _kinds(agreement)
    with matplotlib.rc_context(TYPOGRAPHY):
        width = max(3, len(kinds)) * _PANEL_INCHES[0]
        height = len(PLANES) * _PANEL_INCHES[1] + _KEY_INCHES + _TITLE_INCHES
        figure = Figure(figsize=(width, height), facecolor="white")
        FigureCanvasAgg(figure)
        panels = figure.subplots(len(PLANES), len(kinds), squeeze=False)
        for row, plane in enumerate(PLANES):
            for column, (joint, angles) in enumerate(kinds.items()):
                what = meaning(angles[0].segment)[row]
                _draw_panel(panels[row][column], angles, row, f"{joint}, {what}")
            panels[row][0].set_ylabel(f"{plane} plane\nours less theirs [°]")
        for axes in panels[-1]:
            axes.set_xlabel("mean of both [°]")
        handles = [
            Line2D([], [], color=colour, linestyle="", marker="o", markersize=4.0, label=name)
            for name, colour in (("left", LEFT), ("right", RIGHT), ("trunk", CENTRE))
        ]
        handles.append(Line2D([], [], color=INK, linewidth=1.2, label="bias"))
        handles.append(Line2D([], [], color=INK, linewidth=0.8, linestyle="--", label="95 % of the differences"))
        figure.legend(handles=handles, loc="lower center", ncols=len(handles))
        figure.align_ylabels()
        figure.subplots_adjust(
            left=0.95 / width, right=1.0 - 0.15 / width, bottom=(_KEY_INCHES + 0.1) / height,
            top=1.0 - _TITLE_INCHES / height, wspace=0.3, hspace=0.42,
        )  # fmt: skip
        figure.savefig(path, dpi=_DOTS_PER_INCH, format="png")


def _kinds(agreement: Agreement) -> dict[str, list[AngleAgreement]]:
    """Kind of joint -> its sides, in the order of ``JOINT_ABOVE``."""
    found: dict[str, list[AngleAgreement]] = {}
    for angle in agreement.angles:
        kind = kind_and_side(angle.segment)[0]
        found.setdefault(JOINT_ABOVE.get(kind, kind), []).append(angle)
    order = [*JOINT_ABOVE.values()]
    return dict(sorted(found.items(), key=lambda item: order.index(item[0]) if item[0] in order else len(order)))


def _draw_panel(axes: Axes, angles: list[AngleAgreement], plane: int, title: str) -> None:
    ours, theirs = (np.degrees([of(angle)[:, plane] for angle in angles]) for of in (_ours, _theirs))
    axes.set_title(title, fontsize=9.0, loc="left")
    if not np.isfinite(theirs).any():
        what = "not told by\ncentres of joints"
        axes.text(0.5, 0.5, what, transform=axes.transAxes, ha="center", va="center", color=QUIET)
        axes.set_xticks([])
        axes.set_yticks([])
        return
    limits = LimitsOfAgreement.of(ours, theirs)
    for angle, a, b in zip(angles, ours, theirs, strict=True):
        some = slice(None, None, -(-len(a) // _MOST_DOTS))
        axes.plot(
            (a + b)[some] / 2.0, (a - b)[some], ".", color=side_colour(angle.segment), markersize=3.5, alpha=0.5,
            markeredgewidth=0.0,
        )  # fmt: skip
    axes.axhline(0.0, color=QUIET, linewidth=0.5)
    for value, style, width in ((limits.bias, "-", 1.2), (limits.low, "--", 0.8), (limits.high, "--", 0.8)):
        axes.axhline(value, color=INK, linewidth=width, linestyle=style)
    for value, place, across, up in (
        (limits.high, "bottom", 1.0, 2), (limits.low, "top", 1.0, -2), (limits.bias, "bottom", 0.0, 2),
    ):  # fmt: skip
        axes.annotate(
            number(value, signed=True), (across, value), (2 - 4 * across, up), xycoords=("axes fraction", "data"),
            textcoords="offset points", ha="right" if across else "left", va=place, fontsize=7.5, color=INK,
        )  # fmt: skip
    difference = np.abs(ours - theirs)
    reach = max(_LEAST_DEG, 1.25 * float(np.nanmax(difference)))
    axes.set_ylim(-reach, reach)
    light_grid(axes)


def _ours(angle: AngleAgreement) -> Array:
    return angle.ours


def _theirs(angle: AngleAgreement) -> Array:
    return angle.theirs


_UPPER, _LOWER = ("spine", "neck", "shoulder", "elbow"), ("hip", "knee", "ankle")
_ROOT = "pelvis"
_COLUMNS = 4
_WIDTH_INCHES, _ROW_INCHES, _JOINTS_KEY_INCHES = 16.0, 2.5, 0.3
_DASHED = (0, (3, 2))


def draw_joints(solved: SolvedRecording, agreement: Agreement, path: Path) -> None:
    """Write the picture as PNG: upper body above, lower body below, as in the paper; angles, then positions.

    Raises:
        OSError: the file cannot be written.
    """
    has_angles = bool(agreement.angles)
    count = 4 if has_angles else 2
    with matplotlib.rc_context(TYPOGRAPHY):
        height = _ROW_INCHES * count
        figure = Figure(figsize=(_WIDTH_INCHES, height + _JOINTS_KEY_INCHES), facecolor="white")
        FigureCanvasAgg(figure)
        panels = figure.subplots(count, _COLUMNS, sharex=True, squeeze=False)
        off = panels[count - 2 :]
        for row, joints in enumerate((_UPPER, _LOWER)):
            if has_angles:
                for axes, joint in zip(panels[row], joints, strict=False):
                    _draw_turned(axes, solved, agreement, joint)
                panels[row][0].set_ylabel("turned [°]")
            for axes, joint in zip(off[row], (*joints, _ROOT)[:_COLUMNS], strict=False):
                _draw_off(axes, solved, agreement, joint)
            off[row][0].set_ylabel("off [cm]")
        if has_angles:
            panels[1][-1].axis("off")
        for axes in panels[-1]:
            axes.set_xlabel("time [s]")
        handles = _key(agreement, has_angles)
        figure.legend(handles=handles, loc="lower center", ncols=len(handles))
        figure.align_ylabels()
        figure.subplots_adjust(
            left=0.05,
            right=0.985,
            bottom=(0.5 + _JOINTS_KEY_INCHES) / (height + _JOINTS_KEY_INCHES),
            top=1.0 - 0.4 / height,
            wspace=0.16, hspace=0.34,
        )  # fmt: skip
        figure.savefig(path, dpi=_DOTS_PER_INCH, format="png")


def _draw_turned(axes: Axes, solved: SolvedRecording, agreement: Agreement, joint: str) -> None:
    """Angles of a kind of joint."""
    errors = []
    for angle in agreement.angles:
        if JOINT_ABOVE.get(kind_and_side(angle.segment)[0]) != joint:
            continue
        errors.append(np.degrees(agreement.angle_errors[angle.segment]))
        axes.plot(*_curve(solved, agreement, np.degrees(angle.ours_turned)), color=side_colour(angle.segment), lw=1.5)
        axes.plot(
            *_curve(solved, agreement, np.degrees(angle.theirs_turned)), color=INK, linewidth=0.8, linestyle=_DASHED
        )
    _finish(axes, joint, np.array(errors), "°")


def _draw_off(axes: Axes, solved: SolvedRecording, agreement: Agreement, joint: str) -> None:
    """Position errors of a kind of joint."""
    errors = []
    for point in agreement.joints:
        kind, _ = kind_and_side(point.link)
        if JOINT_ABOVE.get(kind, kind) != joint:
            continue
        errors.append(CM_PER_M * point.errors)
        axes.plot(*_curve(solved, agreement, errors[-1]), color=side_colour(point.link), linewidth=1.2)
    axes.set_ylim(bottom=0.0)
    _finish(axes, joint, np.array(errors), " cm")


def _finish(axes: Axes, joint: str, errors: Array, unit: str) -> None:
    known = errors[np.isfinite(errors)]
    panel_title(axes, joint, f"error {known.mean():.2f}{unit} mean" if known.size else "not known")
    if known.size:
        light_grid(axes)
    else:
        axes.set_yticks([])
        axes.spines["left"].set_visible(False)


def _curve(solved: SolvedRecording, agreement: Agreement, values: Array) -> tuple[Array, Array]:
    """Times (N,) [s] and values (N,), with a NaN in each gap."""
    stamps_ns = agreement.stamps_ns
    after = np.flatnonzero(np.diff(stamps_ns) > GAP_FRAMES * max(solved.frame_ns, solved.instant_ns)) + 1
    return np.insert(solved.seconds(stamps_ns), after, np.nan), np.insert(values, after, np.nan)


def _key(agreement: Agreement, has_angles: bool) -> list[Line2D]:
    lines = [Line2D([], [], color=c, label=name) for name, c in (("left", LEFT), ("right", RIGHT), ("trunk", CENTRE))]
    theirs = Line2D([], [], color=INK, linewidth=0.9, linestyle=_DASHED, label=agreement.name)
    return [*lines, theirs] if has_angles else lines


_SHOWN = ("torso", "head", "forearm_left", "forearm_right", "foot_left", "foot_right", "pelvis")
"""Of joints: all of them would hide each other."""

_WAY_WIDTH_INCHES, _WAY_INCHES = 14.0, 6.8
_LOW_INCHES = 3.6
"""Height where ways are much longer than high, as when somebody walks; a cube needs all of a panel."""

_WAY_TITLE_INCHES = 0.7
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
        height = _WAY_TITLE_INCHES + _LOW_INCHES + (_WAY_INCHES - _LOW_INCHES) * share
        figure = Figure(figsize=(_WAY_WIDTH_INCHES, height), facecolor="white")
        FigureCanvasAgg(figure)
        for number, panel in enumerate(panels):
            # Axes are square; what is empty of them lies outside of the picture.
            bottom = (height - _WAY_TITLE_INCHES - _WAY_INCHES) / 2.0 / height
            place = (0.01 + 0.5 * number, bottom, 0.48, _WAY_INCHES / height)
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
