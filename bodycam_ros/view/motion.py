"""The instants that a view steps through: of a solved recording, or the N-pose alone."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_edit import n_pose
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.joint_angles import JointAngles
from bodycam_ros.evaluate.stick_figure import bones
from bodycam_ros.geometry import Array

_FRAME_NS = 33_333_333  # where a single instant does not tell


@dataclass(frozen=True, eq=False)
class Motion:
    """The body's movement over T instants, apart from its shape.

    Attributes:
        stamps_ns: (T,) increasing [ns].
        world_T_root: (T, 4, 4) poses of the root segment [m].
        angle_names: (A) joint angles, in the order of ``angles``.
        angles: (T, A) [rad].
        registered: camera -> (stamps (K,) increasing [ns], world_T_camera (K, 4, 4) [m]) where it knew its own pose;
            only cameras of which the recording says so.
    """

    stamps_ns: NDArray[np.int64]
    world_T_root: Array
    angle_names: tuple[str, ...]
    angles: Array
    registered: Mapping[str, tuple[NDArray[np.int64], Array]]

    @classmethod
    def standing(cls, body: BodyModel) -> "Motion":
        """The N-pose at the map's origin, the lowest end of a bone on the floor."""
        names = JointAngles(body).names
        segments = dict(zip(body.segments, n_pose(body, np.eye(4))[:, None], strict=True))
        parents = {joint.child: joint.parent for joint in body.tree_joints}
        lowest = min((min(b.start[0, 2], b.end[0, 2]) for b in bones(segments, parents)), default=0.0)
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
        return body.forward_kinematics(self.world_T_root[instant], joint_angles.rotations(angles))

    def registered_at(self, camera: str, instant: int) -> Array | None:
        """Pose world_T_camera (4, 4) that a camera found for itself within half a frame of an instant; None: lost."""
        stamps_ns, world_T_camera = self.registered[camera]
        row = nearest(stamps_ns, int(self.stamps_ns[instant]), self.frame_ns // 2)
        return None if row is None else world_T_camera[row]


def nearest(stamps_ns: NDArray[np.int64], at_ns: int, within_ns: int) -> int | None:
    """Row of the stamp nearest to a time, if there is one so near."""
    if not len(stamps_ns):
        return None
    row = int(np.argmin(np.abs(stamps_ns - at_ns)))
    return row if abs(int(stamps_ns[row]) - at_ns) <= within_ns else None
