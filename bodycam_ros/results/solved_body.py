"""The body of a solved bag and its motion, apart from the cameras: what other programs ask for."""

import logging
from contextlib import nullcontext
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.equipment_report import EquipmentLog, EquipmentRecord
from bodycam_ros.body.stick_figure import Bone, body_bones
from bodycam_ros.camera.model import optical_frame
from bodycam_ros.errors import RecordingError
from bodycam_ros.files.shown import few
from bodycam_ros.geometry import Array
from bodycam_ros.kinematics.joint_angles import JointAngles, angles_within_a_turn
from bodycam_ros.messages.body import EQUIPMENT, EQUIPMENT_TYPE, equipment_report
from bodycam_ros.messages.factory import Message, numbers, stamp_ns
from bodycam_ros.messages.poses import pose_and_covariance
from bodycam_ros.progress import Progress
from bodycam_ros.recording.bag_file import BagFile
from bodycam_ros.recording.bag_records import read_bag_records
from bodycam_ros.results.body_motion import pose_near
from bodycam_ros.results.provenance import PREVIEW, RECORDING
from bodycam_ros.results.topics import (
    JOINT_STATES,
    MOTION_TOPICS,
    ODOMETRY,
    ROBOT,
    ROBOT_TYPE,
    published_body,
    wrong_message_named,
)

logger = logging.getLogger(__name__)

GAP_FRAMES = 1.5
"""States further apart than this are a gap [frames]; between others the body is known."""

_WITHOUT_GAPS = 10
"""Percentile of the steps between states that is a step without a gap."""


@dataclass(frozen=True, eq=False)
class SolvedBody:
    """A body over T states.

    Attributes:
        path: of the bag.
        body: as ``/robot_description`` has it.
        stamps_ns: (T,) states with joint states and odometry, increasing [ns].
        joint_names: (A) in the order of ``joint_angles``, those of ``JointAngles(body)``.
        joint_angles: (T, A) [rad], [m] of what slides.
        world_T_root: (T, 4, 4) pose of the root link [m].
        root_covariance: (T, 6, 6) of that pose, rotation [rad^2] first, then translation [m^2], in the root's axes.
        equipment: how the body was coupled to it; None without.
    """

    path: Path
    body: BodyModel
    stamps_ns: NDArray[np.int64]
    joint_names: tuple[str, ...]
    joint_angles: Array
    world_T_root: Array
    root_covariance: Array
    equipment: EquipmentRecord | None

    @cached_property
    def placed(self) -> NDArray[np.bool_]:
        """(T,) whether the pose of the equipment is known; without any, always."""
        if self.equipment is None:
            return np.ones(len(self.stamps_ns), bool)
        return np.isin(self.stamps_ns, self.equipment.stamps_ns[self.equipment.placed])

    @cached_property
    def step_ns(self) -> int:
        """Time between two states without a gap [ns]; 1 of a single state."""
        steps = np.diff(self.stamps_ns)
        return int(np.percentile(steps, _WITHOUT_GAPS)) if len(steps) else 1

    @cached_property
    def longest_step_ns(self) -> float:
        """States that are further apart have a gap between them [ns]."""
        return GAP_FRAMES * self.step_ns

    @cached_property
    def world_T_segment(self) -> Array:
        """(T, S, 4, 4) poses of all segments [m], in the order of the body's."""
        return JointAngles(self.body).forward_kinematics(self.world_T_root, self.joint_angles)

    def segments_near(self, at_ns: int) -> Array:
        """(S, 4, 4) poses of all segments at a time [m]; outside the recording, at its nearest state."""
        return np.stack([pose_near(self.stamps_ns, each, at_ns) for each in np.moveaxis(self.world_T_segment, 1, 0)])

    @cached_property
    def world_T_link(self) -> dict[str, Array]:
        """Segment, or optical frame of a camera -> poses (T, 4, 4) in the world [m]."""
        poses = dict(zip(self.body.segments, np.moveaxis(self.world_T_segment, 1, 0), strict=True))
        mounts = self.body.mounts.items()
        return poses | {optical_frame(name): poses[mount.segment] @ mount.segment_T_camera for name, mount in mounts}

    @cached_property
    def body_segments(self) -> tuple[str, ...]:
        """Segments of the body alone, without equipment."""
        return tuple(segment for segment in self.body.segments if segment not in self.body.equipment_segments)

    @cached_property
    def parents(self) -> dict[str, str]:
        """Segment -> its parent segment; the root has none."""
        return {joint.child: joint.parent for joint in self.body.tree_joints}

    def bones(self, world_T_segment: Array | None = None) -> list[Bone]:
        """Lines of body and equipment over the T states, or at other poses (N, S, 4, 4) [m]."""
        poses = self.world_T_segment if world_T_segment is None else world_T_segment
        return body_bones(self.body, np.moveaxis(poses, 1, 0))


class BodyMessages:
    """Collects the messages of a solved body from a bag, in any order; they are joined by their stamps.

    Attributes:
        topics: of these messages.

    Raises:
        RecordingError: a topic is missing, empty or of another type, or what was published is no body.
    """

    def __init__(self, bag: BagFile) -> None:
        for topic, kind in {ROBOT: ROBOT_TYPE, **MOTION_TOPICS}.items():
            _check_topic(bag, topic, kind)
        body = published_body(bag)
        if body is None:
            raise missing_topic(bag, f"no body on {ROBOT}")
        self._path = bag.path
        self._body = body
        self._names = JointAngles(body).names
        self._angles: dict[int, Array] = {}
        self._root: dict[int, tuple[Array, Array]] = {}
        self._coupled = EquipmentLog()
        self.topics = [*MOTION_TOPICS, *([EQUIPMENT] if bag.topics.get(EQUIPMENT) == EQUIPMENT_TYPE else [])]

    def add(self, topic: str, message: Message) -> None:
        """Add a message of one of ``topics``.

        Raises:
            RecordingError: it is of another body, or contradicts itself.
        """
        with wrong_message_named(self._path, topic):
            stamp = stamp_ns(message.header.stamp)
            if topic == EQUIPMENT:
                self._coupled.add(stamp, equipment_report(message))
            elif topic == ODOMETRY:
                self._root[stamp] = pose_and_covariance(message.pose)
            else:
                self._angles[stamp] = self._read_angles(message)

    def solved(self) -> SolvedBody:
        """The body at the states of which joint states and odometry were recorded, with finite values.

        Raises:
            RecordingError: there are none.
        """
        both = sorted(self._angles.keys() & self._root.keys())
        stamps = [s for s in both if np.isfinite(self._angles[s]).all() and np.isfinite(self._root[s][0]).all()]
        if not stamps:
            raise RecordingError(
                f"{self._path}: none of {len(self._angles)} {JOINT_STATES} has an {ODOMETRY} of the same stamp and "
                "finite values; record both, from one solver"
            )
        poses, covariances = zip(*(self._root[stamp] for stamp in stamps), strict=True)
        angles = np.array([self._angles[stamp] for stamp in stamps]).reshape(len(stamps), len(self._names))
        # Files of motion have angles that count turns.
        turning = angles_within_a_turn(self._body)
        angles[:, turning] = np.unwrap(angles[:, turning], axis=0)
        states = np.array(stamps, np.int64), self._names, angles, np.array(poses), np.array(covariances)
        return SolvedBody(self._path, self._body, *states, self._coupled.record())

    def _read_angles(self, message: Message) -> Array:
        column = {name: column for column, name in enumerate(message.name)}
        if missing := [name for name in self._names if name not in column]:
            others = [name for name in column if name not in self._names]
            raise RecordingError(
                f"{self._path}: {JOINT_STATES} lacks {few(missing, 6)}, which {ROBOT} has"
                f"{', but has ' if others else ''}{few(others, 6)}; both must be of the same body"
            )
        angles: Array = numbers(message.position, np.float64, len(message.name))[[column[n] for n in self._names]]
        return angles


def read_solved_body(path: Path, progress: Progress | None = None) -> SolvedBody:
    """Read a solved body, without its cameras; the user is warned where that is a preview.

    Args:
        path: ros2 bag folder or file.
        progress: of the messages.

    Raises:
        RecordingError: not a bag, a topic is missing or empty, or the topics do not fit each other.
    """
    with BagFile(path) as bag:
        messages = BodyMessages(bag)
        total = sum(map(bag.message_count, messages.topics))
        step: Any = nullcontext(int) if progress is None else progress.step(f"motion of {path.name}", total)
        with step as advance:
            for topic, _, message in bag.messages(messages.topics):
                advance()
                messages.add(topic, message)
    solved = messages.solved()
    if preview := read_bag_records(path).metadata.get(RECORDING, {}).get(PREVIEW):
        logger.warning("%s: is a preview, not the result: %s of the recording", path, preview)
    return solved


def plain_name(path: Path) -> str:
    """Name of a bag: of its folder, or of its file without suffix."""
    place = path.resolve()
    return place.stem if place.is_file() else place.name


def _check_topic(bag: BagFile, topic: str, wanted: str) -> None:
    kind = bag.topics.get(topic)
    if kind is not None and kind != wanted:
        raise RecordingError(f"{bag.path}: {topic} is {kind}, expected {wanted}")
    if kind is None or bag.message_count(topic) == 0:
        raise missing_topic(bag, f"{'no topic' if kind is None else 'no message on'} {topic}")


def missing_topic(bag: BagFile, what: str) -> RecordingError:
    """The error of a bag that lacks a topic or its messages."""
    return RecordingError(
        f"{bag.path}: {what}; expected a bag that 'bodycam replay' wrote, or a recording of all topics of the live "
        f"graph; there are: {', '.join(bag.topics) or 'none at all'}"
    )
