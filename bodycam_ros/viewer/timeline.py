"""Curves of joint angles and bands of what cameras knew, over the time of a recording, as markup for the page."""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.errors import BodyError, RecordingError
from bodycam_ros.geometry import Array
from bodycam_ros.kinematics.joint_angles import JointAngles
from bodycam_ros.messages.factory import stamp_ns
from bodycam_ros.messages.health import EQUIPMENT, EQUIPMENT_TYPE
from bodycam_ros.messages.tracks import transform_from_pose
from bodycam_ros.plots.picture_style import FAINT, GOOD, INK, QUIET, RELATIVE, ROTATION_ONLY, WARNING
from bodycam_ros.plots.stick_figure import Bone, body_bones, equipment_lines
from bodycam_ros.recording.bag_file import BagFile
from bodycam_ros.registration.landmark_matches import CameraSight
from bodycam_ros.results.body_motion import BodyMotion, MotionJoiner, nearest
from bodycam_ros.results.topics import JOINT_STATES, MOTION_TOPICS, ODOMETRY, ROBOT, camera_topics, published_robot
from bodycam_ros.results.urdf_tree import UrdfTree

SIGHT_COLOURS = {
    CameraSight.REGISTERED: GOOD,
    CameraSight.RELATIVE: RELATIVE,
    CameraSight.ROTATION_ONLY: ROTATION_ONLY,
    CameraSight.BLIND: WARNING,
}
"""Those of ``bodycam evaluate``."""

LABELS_PX, EDGE_PX = 96, 10
"""Left and right of everything that has time for its axis."""

_WIDE = 1000.0  # of a curve, in units of its own; the page stretches it
_CURVE_PX, _BAND_PX, _GAP_PX = 64, 11, 6
_LEGEND_PX = 14
_COLUMNS = 300  # of a curve; between the least and the greatest of each nothing is lost
_NO_IMAGE = -1
_ROOM = 0.06  # above and below a curve
_LEAST_DEG = 10.0  # that a curve is high


@dataclass(frozen=True, eq=False)
class Curve:
    """One angle over time.

    Attributes:
        seconds: (T,) [s].
        degrees: (T,) [deg].
        colour: ``#rrggbb``.
        is_other: whether it is of the recording that is compared with, and dashed.
    """

    seconds: Array
    degrees: Array
    colour: str
    is_other: bool = False


def curve_rows(rows: Mapping[str, Sequence[Curve]], duration_s: float) -> str:
    """A row for each name, with its curves on one scale [deg]."""
    return "".join(_curve_row(name, curves, duration_s) for name, curves in rows.items())


def band_rows(bands: Mapping[str, tuple[Array, NDArray[np.int8]]], duration_s: float) -> str:
    """A row for each camera: the seconds (K,) of its images, and a ``CameraSight`` for each; and what colours mean."""
    rows = "".join(_band_row(camera, *band, duration_s) for camera, band in bands.items())
    seen = sorted({int(sight) for _, sights in bands.values() for sight in np.unique(sights)})
    known = (
        f'<span style="color:{SIGHT_COLOURS[CameraSight(sight)]}">&#9632;</span> {CameraSight(sight).label}&#8194;'
        for sight in seen
    )
    legend = f'<div style="font-size:0.7em">{"".join(known)}</div>'
    return rows + _row("", legend, _LEGEND_PX)


def cursor(share: float, height_px: int) -> str:
    """A line through the rows above it, at a share of the time."""
    left = f"calc({LABELS_PX}px + (100% - {LABELS_PX + EDGE_PX}px) * {share:.4f})"
    return (
        f'<div style="position:relative;height:0"><div style="position:absolute;left:{left};bottom:0;width:1px;'
        f'height:{height_px}px;background:{INK};pointer-events:none"></div></div>'
    )


def height_of(curves: int, bands: int) -> int:
    """Of so many rows with a line of colours below the bands [px]."""
    return curves * (_CURVE_PX + _GAP_PX) + bands * (_BAND_PX + _GAP_PX) + (_LEGEND_PX + _GAP_PX if bands else 0)


def _curve_row(name: str, curves: Sequence[Curve], duration_s: float) -> str:
    low = min((float(np.nanmin(curve.degrees)) for curve in curves), default=0.0)
    high = max((float(np.nanmax(curve.degrees)) for curve in curves), default=0.0)
    widen = max(0.0, _LEAST_DEG - (high - low)) / 2.0
    low, high = low - widen, high + widen
    scale = _CURVE_PX * (1.0 - 2.0 * _ROOM) / (high - low)
    lines = []
    for curve in curves:
        x, y = _thinned(curve.seconds / max(duration_s, 1e-9) * _WIDE, curve.degrees)
        points = " ".join(f"{a:.1f},{_CURVE_PX * _ROOM + (high - b) * scale:.1f}" for a, b in zip(x, y, strict=True))
        dashes = ' stroke-dasharray="4 3"' if curve.is_other else ""
        lines.append(
            f'<polyline points="{points}" fill="none" stroke="{curve.colour}" stroke-width="1.4"{dashes} '
            'vector-effect="non-scaling-stroke"/>'
        )
    zero = _CURVE_PX * _ROOM + high * scale
    if low < 0.0 < high:
        lines.insert(0, f'<path d="M0 {zero:.1f}H{_WIDE:g}" stroke="#b9c1c8" vector-effect="non-scaling-stroke"/>')
    drawn = (
        f'<svg viewBox="0 0 {_WIDE:g} {_CURVE_PX}" preserveAspectRatio="none" style="display:block;width:100%;'
        f'height:{_CURVE_PX}px;background:{FAINT}55">{"".join(lines)}</svg>'
    )
    scale_of = f'<div style="color:{QUIET}">{low:.0f} to {high:.0f}°</div>'
    return _row(f"{escape(name)}{scale_of}", drawn, _CURVE_PX)


def _band_row(camera: str, seconds: Array, sights: NDArray[np.int8], duration_s: float) -> str:
    """Of images that share a column the worst shows."""
    columns = np.full(_COLUMNS, _NO_IMAGE, np.int8)
    frame = float(np.median(np.diff(seconds))) if len(seconds) > 1 else 0.0
    per_second = _COLUMNS / max(duration_s + frame, 1e-9)
    for second, sight in zip(seconds.tolist(), sights.tolist(), strict=True):
        # An image stands for the time up to the next one.
        first, last = max(int(second * per_second), 0), int(np.ceil((second + frame) * per_second))
        part = columns[first : max(last, first + 1)]
        np.maximum(part, sight, out=part)
    edges = [0, *(np.flatnonzero(np.diff(columns)) + 1).tolist(), _COLUMNS]
    parts = [
        f'<div style="position:absolute;left:{_percent(first)};width:{_percent(end - first)};height:100%;'
        f'background:{SIGHT_COLOURS[CameraSight(int(columns[first]))]}"></div>'
        for first, end in pairwise(edges)
        if columns[first] != _NO_IMAGE
    ]
    band = f'<div style="position:relative;height:{_BAND_PX}px;background:{FAINT}">{"".join(parts)}</div>'
    return _row(escape(camera.replace("_", " ")), band, _BAND_PX)


def _percent(columns: int) -> str:
    return f"{100.0 * columns / _COLUMNS:.2f}%"


def _row(label: str, content: str, height_px: int) -> str:
    return (
        f'<div style="display:flex;align-items:center;height:{height_px}px;margin-bottom:{_GAP_PX}px">'
        f'<div style="flex:0 0 {LABELS_PX - 8}px;margin-right:8px;font-size:0.7em;line-height:1.1;text-align:right;'
        f'overflow-wrap:anywhere">{label}</div>'
        f'<div style="flex:1;min-width:0;margin-right:{EDGE_PX}px">{content}</div></div>'
    )


def _thinned(x: Array, y: Array) -> tuple[Array, Array]:
    """A curve of at most so many columns: of each the least and the greatest value, in their order."""
    known = np.isfinite(y)
    x, y = x[known], y[known]
    if len(x) <= 2 * _COLUMNS:
        return x, y
    kept = []
    for rows in np.array_split(np.arange(len(x)), _COLUMNS):
        kept += sorted({int(rows[np.argmin(y[rows])]), int(rows[np.argmax(y[rows])])})
    return x[kept], y[kept]


_POSE, _POSE_TYPE = "/pose", "geometry_msgs/msg/PoseWithCovarianceStamped"
_FRAME_NS = 33_333_333  # where a single instant does not tell


@dataclass(frozen=True, eq=False)
class Motion:
    """The body's movement over T instants, apart from its shape.

    Attributes:
        stamps_ns: (T,) increasing [ns].
        world_T_root: (T, 4, 4) poses of the root segment [m].
        angle_names: (A) joint angles, in the order of ``angles``.
        angles: (T, A) [rad], [m] of places.
        registered: camera -> (stamps (K,) increasing [ns], world_T_camera (K, 4, 4) [m]) where it knew its own pose;
            only cameras of which the recording says so.
        equipment: lines of what the recording has beside the body, and the body file does not, over the T instants.
        unplaced: instants at which nobody knew yet where that is.
    """

    stamps_ns: NDArray[np.int64]
    world_T_root: Array
    angle_names: tuple[str, ...]
    angles: Array
    registered: Mapping[str, tuple[NDArray[np.int64], Array]]
    equipment: tuple[Bone, ...] = ()
    unplaced: frozenset[int] = frozenset()

    @classmethod
    def standing(cls, body: BodyModel) -> "Motion":
        """The N-pose at the map's origin, the lowest end of a bone on the floor."""
        names = JointAngles(body).names
        standing = body_bones(body, body.n_pose(np.eye(4)))
        lowest = min((min(bone.start[0, 2], bone.end[0, 2]) for bone in standing), default=0.0)
        world_T_root = np.eye(4)
        world_T_root[2, 3] = -lowest
        return cls(np.zeros(1, np.int64), world_T_root[None], names, np.zeros((1, len(names))), {})

    @property
    def seconds(self) -> Array:
        """(T,) times since the first instant [s]."""
        return np.asarray((self.stamps_ns - self.stamps_ns[0]) * 1e-9, dtype=np.float64)

    @property
    def frame_ns(self) -> int:
        """Time from one instant to the next, the median [ns]."""
        return int(np.median(np.diff(self.stamps_ns))) if len(self.stamps_ns) > 1 else _FRAME_NS

    def instant_at(self, seconds: float) -> int:
        """The instant nearest to a time since the first."""
        return int(np.argmin(np.abs(self.seconds - seconds)))

    def segments_at(self, body: BodyModel, instant: int) -> Array:
        """Poses world_T_segment (S, 4, 4) [m] of a body that moves so, in the order of its segments."""
        joint_angles = JointAngles(body)
        column = {name: column for column, name in enumerate(self.angle_names)}
        angles = self.angles[instant, [column[name] for name in joint_angles.names]]
        return joint_angles.forward_kinematics(self.world_T_root[instant], angles)

    def equipment_at(self, instant: int) -> list[Bone]:
        """The lines of what stands beside the body at one instant; none while nobody knows where it is."""
        return [] if instant in self.unplaced else [line.at(instant) for line in self.equipment]

    def registered_at(self, camera: str, instant: int) -> Array | None:
        """Pose world_T_camera (4, 4) that a camera found for itself within half a frame of an instant; None: lost."""
        stamps_ns, world_T_camera = self.registered[camera]
        row = nearest(stamps_ns, int(self.stamps_ns[instant]), self.frame_ns // 2)
        return None if row is None else world_T_camera[row]


def read_motion(path: Path, body: BodyModel) -> Motion:
    """Read how a body moved.

    Args:
        path: ros2 bag folder or .mcap file.
        body: that it should be the motion of.

    Raises:
        RecordingError: not a bag, or without joint states and odometry of the same instants.
        BodyError: the bag is of a body with other joints or another root.
    """
    names = JointAngles(body).names
    poses: dict[str, dict[int, Array]] = defaultdict(dict)
    unplaced_ns = set()
    with BagFile(path) as bag:
        check_topics(bag)
        robot = UrdfTree.parse(text, f"{path}: {ROBOT}") if (text := published_robot(bag)) else None
        beside = () if robot is None else tuple(name for name in robot.moving_beside if name not in names)
        joiner = MotionJoiner(path, (*names, *beside), f"body {body.name}")
        cameras = {t: c for t, c in camera_topics(bag, _POSE, _POSE_TYPE).items() if c in body.mounts}
        coupled = [EQUIPMENT] if beside and bag.topics.get(EQUIPMENT) == EQUIPMENT_TYPE else []
        for topic, _, message in bag.messages([*MOTION_TOPICS, *coupled, *cameras]):
            if topic in MOTION_TOPICS:
                joiner.add(topic, message)
            elif topic in coupled:
                if not message.placed:
                    unplaced_ns.add(stamp_ns(message.header.stamp))
            else:
                poses[cameras[topic]][stamp_ns(message.header.stamp)] = transform_from_pose(message.pose.pose)
    motion = joiner.joined()
    _check_body(joiner, body, path)
    return Motion(
        stamps_ns=motion.stamps_ns,
        world_T_root=motion.world_T_root,
        angle_names=names,
        angles=motion.joint_angles[:, : len(names)],
        # Where some cameras' poses were recorded, a camera without one never knew where it was.
        registered={camera: _in_order(poses[camera]) for camera in body.mounts} if cameras else {},
        equipment=_lines_beside(robot, motion) if robot is not None and beside else (),
        unplaced=frozenset(i for i, stamp in enumerate(motion.stamps_ns.tolist()) if stamp in unplaced_ns),
    )


def _lines_beside(robot: UrdfTree, motion: BodyMotion) -> tuple[Bone, ...]:
    """Where the recording has what stands beside the body; corrections of the body do not move it."""
    angles = dict(zip(motion.joint_names, motion.joint_angles.T, strict=True))
    return tuple(equipment_lines(robot.forward_kinematics(motion.world_T_root, angles), robot.equipment))


def _in_order(poses: dict[int, Array]) -> tuple[NDArray[np.int64], Array]:
    stamps = sorted(poses)
    return np.array(stamps, dtype=np.int64), np.array([poses[stamp] for stamp in stamps]).reshape(-1, 4, 4)


def check_topics(bag: BagFile) -> None:
    """Refuse a bag without a body's motion.

    Raises:
        RecordingError: so it is.
    """
    for topic, wanted in MOTION_TOPICS.items():
        kind = bag.topics.get(topic)
        if kind != wanted or bag.message_count(topic) == 0:
            came = "no such topic" if kind is None else "no message on it" if kind == wanted else f"it is {kind}"
            raise RecordingError(
                f"{bag.path}: expected {topic} ({wanted}), {came}; OUT is a bag that 'bodycam replay' wrote, the "
                "images that it was made from go to --recording"
            )


def _check_body(joiner: MotionJoiner, body: BodyModel, path: Path) -> None:
    if joiner.others:
        raise BodyError(
            f"{path}: {JOINT_STATES} is of another body than the one given with --body: only the bag has "
            f"{', '.join(sorted(joiner.others))}"
        )
    if others := sorted(joiner.roots - {body.root}):
        raise BodyError(f"{path}: {ODOMETRY} is of {', '.join(others)}, but the root of the body is {body.root}")
