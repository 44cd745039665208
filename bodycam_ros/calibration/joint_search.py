"""Virtual cameras and joint centres of a whole body (A 4.2, eq. 6-7, 12-14)."""

from collections.abc import Mapping
from dataclasses import dataclass

from bodycam_ros.body.segment_name import SegmentName
from bodycam_ros.calibration.camera_motion import CameraMotion
from bodycam_ros.calibration.joint_centre import JointCentre, find_joint_centre
from bodycam_ros.calibration.rig import Rig
from bodycam_ros.calibration.virtual_camera import VirtualCamera, fuse_cameras
from bodycam_ros.errors import RangeOfMotionError
from bodycam_ros.geometry import inverse

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
            f"the rig has cameras on {rig.root} only; a body needs cameras on two segments that share a joint"
        )
    virtual, centres = {}, {}
    for segment in rig.segments:  # A eq. 6-7
        names = rig.cameras_on(segment)
        own = [motion.cameras.index(camera) for camera in names]
        virtual[segment] = fuse_cameras(names, motion.world_T_camera[:, own], motion.known[:, own])
    duration_s = motion.duration_s
    for child in rig.segments:  # A eq. 12-14
        if (parent := rig.parents[child]) is None:
            continue
        above, below = virtual[parent], virtual[child]
        both = above.known & below.known
        if (together_s := duration_s * float(both.mean())) < _MIN_TOGETHER_S:
            raise RangeOfMotionError(
                f"joint {SegmentName(child).joint}: cameras on {parent} and on {child} were registered together for "
                f"{together_s:.1f} s only, of {duration_s:.1f} s; {_MIN_TOGETHER_S:g} s are needed. Repeat it where "
                "both see the mapped place"
            )
        centres[child] = find_joint_centre((inverse(above.world_T_virtual) @ below.world_T_virtual)[both])
    return FoundJoints(virtual, centres)
