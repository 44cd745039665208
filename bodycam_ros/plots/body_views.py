"""The body in the N-pose, as seen from the front and from the right."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Ellipse
from matplotlib.patheffects import withStroke

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.calibration.anthropometry import LEFT as LEFT_SIDE
from bodycam_ros.calibration.anthropometry import SegmentName, mirrored
from bodycam_ros.calibration.diagnosis import BoneDiagnosis, CalibrationDiagnosis
from bodycam_ros.geometry import Array, transform_points
from bodycam_ros.plots.picture_style import (
    CENTRE,
    FAINT,
    INK,
    LEFT,
    QUIET,
    RIGHT,
    WARNING,
    panel_title,
    side_colour,
)
from bodycam_ros.plots.stick_figure import HEAD, Bone, body_bones

_LOOK_M = 0.05  # how far ahead of a camera its mark points

_UNKNOWN_M = {
    "torso": (0.0, 0.0, 0.50),
    "upper_arm": (0.0, 0.0, -0.28),
    "thigh": (0.0, 0.0, -0.42),
    "shin": (0.0, 0.0, -0.43),
}
"""How far a segment is drawn where none hangs on it: nobody knows how long a thigh is whose shin carries no camera."""


@dataclass(frozen=True, eq=False)
class StandingBody:
    """The body in the N-pose, in the root's frame.

    Attributes:
        lines: of the skeleton.
        unknown: lines of last segments, whose length nobody knows.
        joints: joint -> (3,) [m].
        cameras: camera -> (4, 4) pose of its optical frame [m].
    """

    lines: list[Bone]
    unknown: list[Bone]
    joints: dict[str, Array]
    cameras: dict[str, Array]

    @classmethod
    def of(cls, body: BodyModel) -> "StandingBody":
        """Stand a body up."""
        root_T_segment = body.n_pose(np.eye(4))
        poses = dict(zip(body.segments, root_T_segment, strict=True))
        lines = body_bones(body, root_T_segment)
        drawn = {bone.segment for bone in lines} | body.equipment_segments
        return cls(
            lines=lines,
            unknown=[
                Bone(segment, pose[None, :3, 3], transform_points(pose, np.array([_UNKNOWN_M[kind]])))
                for segment, pose in poses.items()
                if segment not in drawn and (kind := SegmentName(segment).kind) in _UNKNOWN_M
            ],
            joints={joint.name: (poses[joint.parent] @ joint.parent_T_joint)[:3, 3] for joint in body.joints},
            cameras={camera: poses[mount.segment] @ mount.segment_T_camera for camera, mount in body.mounts.items()},
        )

    @property
    def looks(self) -> dict[str, tuple[Array, Array]]:
        """Camera -> where it is (3,), and a point ahead of it (3,) [m]."""
        return {name: (pose[:3, 3], pose[:3, 3] + _LOOK_M * pose[:3, 2]) for name, pose in self.cameras.items()}

    def extent(self, axis: int) -> tuple[float, float]:
        """From where to where it goes along an axis, the origin included [m]."""
        ends = [point for bone in (*self.lines, *self.unknown) for point in (bone.start[0], bone.end[0])]
        looks = [point for look in self.looks.values() for point in look]
        along = [0.0, *(float(point[axis]) for point in (*ends, *looks, *self.joints.values()))]
        return min(along), max(along)

    @property
    def reach(self) -> float:
        """How far it goes to its sides [m]."""
        return max(map(abs, self.extent(1)))


_FRONT, _RIGHT = (1, 2), (0, 2)
"""Axes of the N-pose (x forward, y left, z up) that are across and up on the screen."""

_HEAD_RADIUS_M = 0.10
_AXIS_M = 0.065  # half the length that a hinge's axis is drawn with
_AXIS_END_ON_M = 0.02  # an axis that looks shorter is seen from its end
_LABEL_ROOM_M = 0.13  # between the body and the column of labels beside it
_LABEL_IN = 0.95  # [in] that a name takes
_BEYOND_M = 0.06  # above and below everything
_LABEL_STEP_M = 0.052  # between two labels of a column
_BONE_LABEL_M = 0.032  # from a bone to its label
_SIGMAS = 3.0
_RING_M = 0.03  # radius that half of the rings stay below when magnified
_LARGEST_RING_M = 0.15
_MAGNIFICATIONS = (100.0, 50.0, 20.0, 10.0, 5.0, 2.0, 1.0)


def draw_views(front: Axes, side: Axes, body: BodyModel, diagnosis: CalibrationDiagnosis) -> None:
    """Draw both; from the front cameras and bones are named, from the right joints are."""
    standing = StandingBody.of(body)
    magnification = _magnification(diagnosis)
    for axes, screen in ((side, _RIGHT), (front, _FRONT)):
        _draw_skeleton(axes, standing, screen)
        _draw_rings(axes, standing, diagnosis, screen, magnification)
        _draw_hinges(axes, standing, diagnosis, screen)
        _draw_cameras(axes, standing, diagnosis, screen)
        axes.axis("off")
    _frame(front, side, standing)
    _label_bones(front, standing, diagnosis.bones)
    _label_cameras(front, standing, diagnosis)
    _label_joints(side, standing)
    panel_title(front, "N-pose from the front", "its left is on the right")
    panel_title(side, "and from its right")
    _draw_key(front, magnification, bool(standing.unknown))


def _frame(front: Axes, side: Axes, standing: StandingBody) -> None:
    """One scale for both, so that the whole body and its labels have room, whatever part of a body it is."""
    figure = front.get_figure(root=True)
    assert figure is not None
    inches = figure.get_size_inches()
    sizes = {axes: np.array(axes.get_position().size) * inches for axes in (front, side)}
    low, high = standing.extent(2)
    behind, ahead = standing.extent(0)[0] - _BEYOND_M, standing.extent(0)[1] + _LABEL_ROOM_M
    m_per_in = max(
        (high - low + 2.0 * _BEYOND_M) / sizes[front][1],
        2.0 * (standing.reach + _LABEL_ROOM_M) / (sizes[front][0] - 2.0 * _LABEL_IN),
        (ahead - behind) / sizes[side][0],
    )
    front.set_ylim(0.5 * (low + high) + 0.5 * m_per_in * sizes[front][1] * np.array([-1.0, 1.0]))
    for axes, middle in ((front, 0.0), (side, 0.5 * (behind + ahead))):
        axes.set_xlim(middle + 0.5 * m_per_in * sizes[axes][0] * np.array([-1.0, 1.0]))


def _magnification(diagnosis: CalibrationDiagnosis) -> float:
    """How many times larger than life rings are drawn: three sigma of a good joint is less than a pixel."""
    radii = _SIGMAS * np.array([joint.sigma_m.max() for joint in diagnosis.joints])
    usual = float(np.median(radii[np.isfinite(radii)])) if np.isfinite(radii).any() else np.inf
    return next((times for times in _MAGNIFICATIONS if times * usual <= _RING_M), 1.0)


def _draw_skeleton(axes: Axes, standing: StandingBody, screen: tuple[int, int]) -> None:
    across = 3 - sum(screen)
    # The far side first; what is nearer covers it. The viewer stands where x is large, or y small.
    towards = 1.0 if screen == _FRONT else -1.0
    for bone in sorted(standing.lines, key=lambda bone: towards * float(bone.start[0, across] + bone.end[0, across])):
        line = np.stack([bone.start[0], bone.end[0]])[:, screen]
        colour = side_colour(bone.segment)
        if bone.segment == HEAD:
            axes.add_patch(
                Circle(tuple(line[1]), _HEAD_RADIUS_M, facecolor="white", edgecolor=colour, linewidth=1.8, zorder=2)
            )
        axes.plot(*line.T, color=colour, linewidth=3.0, solid_capstyle="round", alpha=0.55, zorder=2)
    for bone in standing.unknown:
        line = np.stack([bone.start[0], bone.end[0]])[:, screen]
        axes.plot(*line.T, color=side_colour(bone.segment), linewidth=2.0, linestyle=":", alpha=0.55, zorder=2)


def _draw_rings(
    axes: Axes,
    standing: StandingBody,
    diagnosis: CalibrationDiagnosis,
    screen: tuple[int, int],
    magnification: float,
) -> None:
    """A joint, and three standard deviations around it."""
    for joint in diagnosis.joints:
        if joint.name not in standing.joints:
            continue
        place = standing.joints[joint.name][list(screen)]
        colour = WARNING if joint.advice else side_colour(joint.name)
        radii = np.minimum(magnification * _SIGMAS * joint.sigma_m[list(screen)], _LARGEST_RING_M)
        if np.isfinite(radii).all():
            axes.add_patch(Ellipse(tuple(place), *(2.0 * radii), facecolor=colour, alpha=0.22, linewidth=0.0, zorder=3))
            axes.add_patch(Ellipse(tuple(place), *(2.0 * radii), fill=False, edgecolor=colour, linewidth=0.9, zorder=3))
        axes.plot(*place, "o", color=colour, markersize=4.0, zorder=4)


def _draw_hinges(axes: Axes, standing: StandingBody, diagnosis: CalibrationDiagnosis, screen: tuple[int, int]) -> None:
    for joint in diagnosis.joints:
        if joint.axis is None or joint.name not in standing.joints:
            continue
        place = standing.joints[joint.name][list(screen)]
        half = _AXIS_M * joint.axis[list(screen)]
        if np.linalg.norm(half) < _AXIS_END_ON_M:
            axes.add_patch(Circle(tuple(place), _AXIS_END_ON_M, fill=False, edgecolor=INK, linewidth=1.3, zorder=4))
        else:
            axes.plot(*np.stack([place - half, place + half]).T, color=INK, linewidth=1.5, zorder=4)


def _draw_cameras(axes: Axes, standing: StandingBody, diagnosis: CalibrationDiagnosis, screen: tuple[int, int]) -> None:
    """A square where a camera is, and a line to where it looks."""
    segments = {camera.camera: camera for camera in diagnosis.cameras}
    for name, look in standing.looks.items():
        known = segments.get(name)
        colour = WARNING if known is not None and known.warning else INK
        line = np.stack(look)[:, screen]
        axes.plot(*line.T, color=colour, linewidth=1.0, zorder=5)
        axes.plot(*line[0], "s", color=colour, markersize=3.6, zorder=5)


def _label_bones(axes: Axes, standing: StandingBody, measured: Sequence[BoneDiagnosis]) -> None:
    """Lengths [cm] along the bones of limbs, and of those of the trunk that run upright or across."""
    for bone in measured:
        if not _is_labelled(bone) or {bone.start, bone.end} - set(standing.joints):
            continue
        start, end = (standing.joints[name][list(_FRONT)] for name in (bone.start, bone.end))
        along = end - start
        upright = abs(along[1]) > abs(along[0])
        middle = 0.5 * (start + end)
        if mirrored(bone.start) == bone.end:
            axes.plot(*np.stack([start, end]).T, color=QUIET, linewidth=0.6, linestyle=(0, (4, 3)), zorder=1)
        # Inside of a limb there is nothing but the other limb; above hips there is the trunk's own bone.
        inwards = -1.0 if bone.segment.endswith(LEFT_SIDE) else 1.0
        shift = np.array([_BONE_LABEL_M * inwards, 0.0]) if upright else np.array([0.0, -_BONE_LABEL_M])
        axes.annotate(
            f"{100.0 * bone.length_m:.1f} cm", middle + shift, rotation=90.0 if upright else 0.0, ha="center",
            va="center", fontsize=8.0, color=WARNING if bone.warning else INK, zorder=6,
            path_effects=[withStroke(linewidth=2.5, foreground="white")],
        )  # fmt: skip


def _is_labelled(bone: BoneDiagnosis) -> bool:
    """Whether both its ends are of one side, of both sides or of none; from neck to shoulder is in the tables."""
    limb = bool(SegmentName(bone.segment).side)
    breadth = mirrored(bone.start) == bone.end
    return limb or breadth or not (SegmentName(bone.start).side or SegmentName(bone.end).side)


def _label_cameras(axes: Axes, standing: StandingBody, diagnosis: CalibrationDiagnosis) -> None:
    """Names in two columns beside the body, in the order of height, each tied to its camera."""
    warned = {camera.camera for camera in diagnosis.cameras if camera.warning}
    places = {name: pose[list(_FRONT), 3] for name, pose in standing.cameras.items()}
    reach = standing.reach
    for sign in (-1.0, 1.0):
        column = sorted(
            (name for name in places if (places[name][0] > 0.0) == (sign > 0.0)), key=lambda n: places[n][1]
        )
        heights = _spread([float(places[name][1]) for name in column])
        for name, height in zip(column, heights, strict=True):
            colour = WARNING if name in warned else INK
            across = sign * (reach + _LABEL_ROOM_M)
            tie = np.array([places[name], [sign * (reach + 0.3 * _LABEL_ROOM_M), height], [across, height]])
            axes.plot(*tie.T, color=WARNING if name in warned else QUIET, linewidth=0.5, alpha=0.7, zorder=1)
            axes.annotate(
                name.replace("_", " "), (across, height), (3.0 * sign, 0.0), textcoords="offset points",
                ha="left" if sign > 0.0 else "right", va="center", fontsize=8.5, color=colour,
            )  # fmt: skip


def _label_joints(axes: Axes, standing: StandingBody) -> None:
    """Names without sides in a column in front of the body: left and right cover each other."""
    kinds: dict[str, list[Array]] = {}
    for name, place in standing.joints.items():
        kinds.setdefault(SegmentName(name).kind, []).append(place)
    places = {kind: np.mean(found, axis=0)[list(_RIGHT)] for kind, found in kinds.items()}
    ordered = sorted(places, key=lambda kind: float(places[kind][1]))
    reach = standing.extent(0)[1] + _LABEL_ROOM_M
    for kind, height in zip(ordered, _spread([float(places[kind][1]) for kind in ordered]), strict=True):
        tie = np.array([places[kind], [reach, height]])
        axes.plot(*tie.T, color=QUIET, linewidth=0.5, alpha=0.7, zorder=1)
        axes.annotate(
            kind.replace("_", " "), (reach, height), (3.0, 0.0), textcoords="offset points",
            va="center", fontsize=8.5, color=INK,
        )  # fmt: skip


def _spread(heights: Sequence[float]) -> list[float]:
    """Rising heights, moved apart as little as keeps a step between any two: pooled like adjacent violators."""
    pools: list[tuple[float, int]] = []  # mean of (height - step * index), and how many
    for index, height in enumerate(heights):
        mean, count = height - _LABEL_STEP_M * index, 1
        while pools and pools[-1][0] > mean:
            earlier, number = pools.pop()
            mean, count = (earlier * number + mean * count) / (number + count), number + count
        pools.append((mean, count))
    shifted = [mean for mean, count in pools for _ in range(count)]
    return [mean + _LABEL_STEP_M * index for index, mean in enumerate(shifted)]


def _draw_key(axes: Axes, magnification: float, has_unknown: bool) -> None:
    times = "" if magnification == 1.0 else f", {magnification:g} times as large"
    sides = (("left", LEFT), ("right", RIGHT), ("centre", CENTRE))
    handles = [Line2D([], [], color=colour, linewidth=3.0, alpha=0.55, label=name) for name, colour in sides]
    if has_unknown:
        handles.append(Line2D([], [], color=CENTRE, linewidth=2.0, linestyle=":", label="length unknown"))
    handles += [
        Line2D([], [], color=INK, linewidth=1.5, label="hinge axis"),
        Line2D([], [], color=INK, marker="s", markersize=3.6, linewidth=1.0, label="camera"),
        Line2D(
            [], [], linestyle="", marker="o", markersize=9.0, markerfacecolor=FAINT, markeredgecolor=QUIET,
            label=f"joint, 3 sigma{times}",
        ),
    ]  # fmt: skip
    axes.legend(
        handles=handles, loc="upper center", bbox_to_anchor=(0.7, -0.005), ncols=len(handles), labelcolor=INK,
        handlelength=1.5, borderaxespad=0.0, columnspacing=1.4,
    )  # fmt: skip
