"""Motion of a body: of a solved bag, or standing in the N-pose."""

from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.stick_figure import Bone, body_bones
from bodycam_ros.errors import BodyError
from bodycam_ros.geometry import Array
from bodycam_ros.kinematics.joint_angles import JointAngles
from bodycam_ros.messages.factory import stamp_ns
from bodycam_ros.messages.poses import transform_from_pose
from bodycam_ros.recording.bag_file import BagFile
from bodycam_ros.results.body_motion import nearest
from bodycam_ros.results.solved_body import read_solved_body
from bodycam_ros.viewer.contacts import Contact, find_contacts

_POSE, _POSE_TYPE = "/pose", "geometry_msgs/msg/PoseWithCovarianceStamped"
_FRAME_NS = 33_333_333  # of a motion with a single state


@dataclass(frozen=True, eq=False)
class Motion:
    """The body's movement over T states, apart from its shape.

    Attributes:
        stamps_ns: (T,) increasing [ns].
        world_T_root: (T, 4, 4) poses of the root segment [m].
        angle_names: (A) joint angles, in the order of ``angles``.
        angles: (T, A) [rad], [m] of joints that slide.
        registered: camera -> (stamps (K,) increasing [ns], world_T_camera (K, 4, 4) [m]) of its registrations; only
            cameras of which the recording has them.
        equipment: lines of the recording's equipment that is not in the body file, over the T states.
        unplaced: states at which the equipment's pose is unknown.
        contacts: feet on the floor, and attachments to equipment.
    """

    stamps_ns: NDArray[np.int64]
    world_T_root: Array
    angle_names: tuple[str, ...]
    angles: Array
    registered: Mapping[str, tuple[NDArray[np.int64], Array]]
    equipment: tuple[Bone, ...] = ()
    unplaced: frozenset[int] = frozenset()
    contacts: tuple[Contact, ...] = ()

    @classmethod
    def standing(cls, body: BodyModel) -> "Motion":
        """The N-pose at the map's origin, the lowest end of a bone on the floor."""
        names = JointAngles(body).names
        standing = body_bones(body, body.n_pose(np.eye(4)))
        world_T_root = np.eye(4)
        world_T_root[2, 3] = -min((min(bone.start[0, 2], bone.end[0, 2]) for bone in standing), default=0.0)
        return cls(np.zeros(1, np.int64), world_T_root[None], names, np.zeros((1, len(names))), {})

    @cached_property
    def seconds(self) -> Array:
        """(T,) times since the first state [s]."""
        return np.asarray((self.stamps_ns - self.stamps_ns[0]) * 1e-9, dtype=np.float64)

    @cached_property
    def frame_ns(self) -> int:
        """Time from one state to the next, the median [ns]."""
        return int(np.median(np.diff(self.stamps_ns))) if len(self.stamps_ns) > 1 else _FRAME_NS

    def state_at(self, seconds: float) -> int:
        """The state nearest to a time since the first."""
        return int(np.argmin(np.abs(self.seconds - seconds)))

    def segments_at(self, body: BodyModel, index: int) -> Array:
        """Poses world_T_segment (S, 4, 4) [m] of a body with this motion, in the order of its segments."""
        return np.asarray(self._segments(body, slice(index, index + 1))[0])

    def segments(self, body: BodyModel) -> Array:
        """Poses world_T_segment (T, S, 4, 4) [m] of a body with this motion at all states."""
        return self._segments(body, slice(None))

    def _segments(self, body: BodyModel, states: slice) -> Array:
        joint_angles = JointAngles(body)
        column = {name: column for column, name in enumerate(self.angle_names)}
        angles = self.angles[states][:, [column[name] for name in joint_angles.names]]
        return joint_angles.forward_kinematics(self.world_T_root[states], angles)

    def equipment_at(self, index: int) -> list[Bone]:
        """The lines of equipment at one state; none while its pose is unknown."""
        return [] if index in self.unplaced else [line.at(index) for line in self.equipment]

    def registered_at(self, camera: str, index: int) -> Array | None:
        """Registered pose world_T_camera (4, 4) of a camera within half a frame of a state; None: lost."""
        stamps_ns, world_T_camera = self.registered[camera]
        row = nearest(stamps_ns, int(self.stamps_ns[index]), self.frame_ns // 2)
        return None if row is None else world_T_camera[row]


def mounted_camera(body: BodyModel, world_T_segment: Array, camera: str) -> Array:
    """(4, 4) pose world_T_camera of a camera on a body at poses (S, 4, 4) [m]."""
    mount = body.mounts[camera]
    world_T_camera: Array = world_T_segment[body.segment_index[mount.segment]] @ mount.segment_T_camera
    return world_T_camera


def in_order(poses: Mapping[int, Array]) -> tuple[NDArray[np.int64], Array]:
    """Stamps (K,) increasing [ns] and poses (K, 4, 4) of a table of them."""
    stamps = sorted(poses)
    return np.array(stamps, dtype=np.int64), np.array([poses[stamp] for stamp in stamps]).reshape(-1, 4, 4)


def read_motion(path: Path, body: BodyModel) -> Motion:
    """Read how a body moved.

    Args:
        path: ros2 bag folder or .mcap file.
        body: that it should be the motion of.

    Raises:
        RecordingError: not a bag that a replay wrote, or of a live graph.
        BodyError: the bag is of a body with other joints or another root.
    """
    solved, names = read_solved_body(path), JointAngles(body).names
    column = {name: column for column, name in enumerate(solved.joint_names)}
    of_equipment = (joint for joint in solved.body.tree_joints if joint.child in solved.body.equipment_segments)
    beside = {name for joint in of_equipment for name in joint.angle_names} - {*names}
    there, here = ", ".join(sorted(column.keys() - beside - {*names})), ", ".join(sorted({*names} - column.keys()))
    if there or here or solved.body.root != body.root:
        raise BodyError(
            f"{path}: is of another body than {body.name}, the one given with --body: only the bag has "
            f"{there or 'no joint'}, only the body {here or 'no joint'}; roots are {solved.body.root} and {body.root}"
        )
    poses: dict[str, dict[int, Array]] = defaultdict(dict)
    with BagFile(path) as bag:
        cameras = {t: c for t, c in bag.camera_topics(_POSE, _POSE_TYPE).items() if c in body.mounts}
        for topic, _, message in bag.messages(cameras):
            poses[cameras[topic]][stamp_ns(message.header.stamp)] = transform_from_pose(message.pose.pose)
    return Motion(
        stamps_ns=solved.stamps_ns,
        world_T_root=solved.world_T_root,
        angle_names=names,
        angles=solved.joint_angles[:, [column[name] for name in names]],
        # Where some cameras' poses were recorded, a camera without one was never registered.
        registered={camera: in_order(poses[camera]) for camera in body.mounts} if cameras else {},
        equipment=tuple(bone for bone in solved.bones() if bone.is_equipment) if beside else (),
        unplaced=frozenset(np.flatnonzero(~solved.placed).tolist()),
        contacts=find_contacts(solved),
    )
