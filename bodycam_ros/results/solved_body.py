"""The body of a solved bag and how it moved, apart from the cameras: all that programs for motion ask for."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.equipment_report import EquipmentLog
from bodycam_ros.body.urdf_reader import body_from_urdf
from bodycam_ros.errors import BodyError, RecordingError
from bodycam_ros.kinematics.joint_angles import angles_within_a_turn
from bodycam_ros.mapping.progress import Progress
from bodycam_ros.messages.equipment import EQUIPMENT, EQUIPMENT_TYPE, equipment_report
from bodycam_ros.messages.factory import stamp_ns
from bodycam_ros.recording.bag_file import BagFile
from bodycam_ros.results.body_motion import BodyMotion, MotionJoiner
from bodycam_ros.results.topics import MOTION_TOPICS, ROBOT, ROBOT_TYPE, contradictions_named, published_robot


@dataclass(frozen=True, eq=False)
class SolvedBody:
    """A body over T instants.

    Attributes:
        path: of the bag.
        body: as ``/robot_description`` has it.
        motion: of the body; its angles are in the order of ``JointAngles(body).names``.
        placed: (T,) whether it is known where equipment beside the body is; without any, always.
    """

    path: Path
    body: BodyModel
    motion: BodyMotion
    placed: NDArray[np.bool_]


def read_solved_body(path: Path, progress: Progress) -> SolvedBody:
    """Read what was solved, without what cameras saw.

    Args:
        path: ros2 bag folder or file.
        progress: is told of the messages.

    Raises:
        RecordingError: not a bag, a topic is missing or empty, or the topics do not fit each other.
    """
    with BagFile(path) as bag:
        for topic, kind in {ROBOT: ROBOT_TYPE, **MOTION_TOPICS}.items():
            _check_topic(bag, topic, kind)
        try:
            body = body_from_urdf(published_robot(bag))
        except BodyError as error:
            raise RecordingError(f"{path}: {ROBOT}: {error}") from error
        names = tuple(name for joint in body.tree_joints for name in joint.angle_names)
        moved, coupled = MotionJoiner(path, names, ROBOT), EquipmentLog()
        equipment = [EQUIPMENT] if bag.topics.get(EQUIPMENT) == EQUIPMENT_TYPE else []
        topics = [*MOTION_TOPICS, *equipment]
        with progress.step(f"motion of {path.name}", sum(map(bag.message_count, topics))) as advance:
            for topic, _, message in bag.messages(topics):
                advance()
                if topic in MOTION_TOPICS:
                    moved.add(topic, message)
                    continue
                with contradictions_named(path, topic):
                    coupled.add(stamp_ns(message.header.stamp), equipment_report(message))
    motion, record = _without_dropped_turns(body, moved.joined()), coupled.record()
    placed = np.ones(len(motion.stamps_ns), bool)
    if record is not None:
        placed = np.isin(motion.stamps_ns, record.stamps_ns[record.placed])
    return SolvedBody(path, body, motion, placed)


def _without_dropped_turns(body: BodyModel, motion: BodyMotion) -> BodyMotion:
    """The motion with angles that count turns, as files of motion have them."""
    angles, turning = motion.joint_angles.copy(), angles_within_a_turn(body)
    angles[:, turning] = np.unwrap(angles[:, turning], axis=0)
    return replace(motion, joint_angles=angles)


def plain_name(path: Path) -> str:
    """Name of a bag: of its folder, or of its file without what says that it is one."""
    place = path.resolve()
    return place.stem if place.is_file() else place.name


def _check_topic(bag: BagFile, topic: str, wanted: str) -> None:
    kind = bag.topics.get(topic)
    if kind == wanted and bag.message_count(topic):
        return
    found = (
        f"it is {kind}" if kind not in (None, wanted) else "no message is on it" if kind else "there is no such topic"
    )
    raise RecordingError(
        f"{bag.path}: {topic} ({wanted}) is missing: {found}; expected a bag that 'bodycam replay' wrote, or a "
        f"recording of the live graph; there are: {', '.join(bag.topics) or 'none at all'}"
    )
