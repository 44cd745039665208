"""Virtual cameras and joint centres of a whole body (A 4.2, eq. 6-7, 12-14)."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from bodycam_ros.body.segment_name import SegmentName
from bodycam_ros.calibration.anthropometry import BoneLength
from bodycam_ros.calibration.camera_motion import CameraMotion
from bodycam_ros.calibration.joint_centre import JointCentre, find_joint_centre
from bodycam_ros.calibration.rig import Rig
from bodycam_ros.calibration.virtual_camera import VirtualCamera, fuse_cameras
from bodycam_ros.errors import RangeOfMotionError
from bodycam_ros.geometry import Array, inverse

_MIN_TOGETHER_S = 2.5  # that both segments of a joint are known


@dataclass(frozen=True, eq=False)
class FoundJoints:
    """The joints by the motion of the cameras, before the N-pose gives the segments their axes.

    Attributes:
        virtual: segment -> its cameras as one.
        centres: child segment -> the joint that it hangs on, in the frames of the virtual cameras.
    """

    virtual: Mapping[str, VirtualCamera]
    centres: Mapping[str, JointCentre]

    @property
    def virtual_T_camera(self) -> dict[str, Array]:
        """Camera -> (4, 4) its mount on its segment's virtual camera."""
        return {camera: pose for one in self.virtual.values() for camera, pose in one.virtual_T_camera.items()}

    def bone_lengths(self, rig: Rig) -> list[BoneLength]:
        """Bones between joints found so far; along the axis of a hinge its joint may be anywhere near the camera."""
        bones = []
        for child, below in self.centres.items():
            segment = str(rig.parents[child])
            if (above := self.centres.get(segment)) is not None:
                length_m = float(np.linalg.norm(below.in_parent - above.in_child))
                start, end = SegmentName(segment).joint, SegmentName(child).joint
                bones.append(BoneLength(segment, start, end, length_m, sigma_m=0.0))
        return bones


def find_joints(rig: Rig, motion: CameraMotion) -> FoundJoints:
    """Find virtual cameras and joints.

    Args:
        rig: which camera is on which segment.
        motion: of the cameras.

    Raises:
        RangeOfMotionError: cameras that should be registered together never are, or there is no joint to find.
    """
    if len(rig.segments) < 2:
        raise RangeOfMotionError(
            f"the rig has cameras on {rig.root} only; a body needs cameras on two segments that hang together"
        )
    virtual = _virtual_cameras(rig, motion)  # A eq. 6-7
    return FoundJoints(virtual, _joint_centres(rig, motion, virtual))  # A eq. 12-14


def _virtual_cameras(rig: Rig, motion: CameraMotion) -> dict[str, VirtualCamera]:
    """Segment -> its cameras as one (A eq. 6-7)."""
    columns = {segment: motion.columns(rig.cameras_on(segment)) for segment in rig.segments}
    return {
        segment: fuse_cameras(rig.cameras_on(segment), motion.world_T_camera[:, own], motion.known[:, own])
        for segment, own in columns.items()
    }


def _joint_centres(rig: Rig, motion: CameraMotion, virtual: Mapping[str, VirtualCamera]) -> dict[str, JointCentre]:
    """Child segment -> its joint, from every pair of cameras on the two segments (A eq. 12-14)."""
    centres = {}
    for child in rig.segments:
        parent = rig.parents[child]
        if parent is None:
            continue
        parent_T_child = []
        for a in rig.cameras_on(parent):
            world_T_parent = motion.poses(a) @ inverse(virtual[parent].virtual_T_camera[a])
            for b in rig.cameras_on(child):
                world_T_child = motion.poses(b) @ inverse(virtual[child].virtual_T_camera[b])
                both = motion.known[:, motion.columns((a, b))].all(axis=1)
                parent_T_child.append((inverse(world_T_parent) @ world_T_child)[both])
        duration_s = float(motion.seconds[-1])
        together_s = duration_s * max(map(len, parent_T_child)) / len(motion.seconds)
        if together_s < _MIN_TOGETHER_S:
            raise RangeOfMotionError(
                f"joint {SegmentName(child).joint}: cameras on {parent} and on {child} were registered together for "
                f"{together_s:.1f} s only, of {duration_s:.1f} s; {_MIN_TOGETHER_S:g} s are needed. Repeat it where "
                "both see the mapped place"
            )
        centres[child] = find_joint_centre(np.concatenate(parent_T_child))
    return centres
