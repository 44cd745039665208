"""The instants that a view steps through: of a solved recording, or the N-pose alone."""

from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.drawing.stick_figure import Bone, body_bones, equipment_lines
from bodycam_ros.errors import BodyError, RecordingError
from bodycam_ros.geometry import Array
from bodycam_ros.kinematics.joint_angles import JointAngles
from bodycam_ros.messages.equipment import EQUIPMENT, EQUIPMENT_TYPE
from bodycam_ros.messages.header import stamp_ns
from bodycam_ros.messages.pose import transform_from_pose
from bodycam_ros.recording.bag_file import BagFile
from bodycam_ros.solved.body_motion import BodyMotion, MotionJoiner
from bodycam_ros.solved.topics import JOINT_STATES, MOTION_TOPICS, ODOMETRY, ROBOT, camera_topics, published_robot
from bodycam_ros.solved.trajectory import nearest
from bodycam_ros.solved.urdf_tree import UrdfTree

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
