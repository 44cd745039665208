"""A body in the N-pose, as lines, joints and cameras to be drawn."""

from dataclasses import dataclass

import numpy as np

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.calibration.anatomy import SegmentName
from bodycam_ros.drawing.stick_figure import Bone, body_bones
from bodycam_ros.geometry import Array, transform_points

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
