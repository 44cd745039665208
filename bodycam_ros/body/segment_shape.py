"""What a segment looks like to programs that want shapes: a ball at its origin, and bones to the joints on it."""

import numpy as np

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.geometry import Array

JOINT_RADIUS_M = 0.04
BONE_RADIUS_M = 0.025


def bone_ends(body: BodyModel, segment: str) -> list[Array]:
    """Where the bones from a segment's origin end (3,) [m]: at each joint that hangs on it, or else at its tip.

    Equipment reaches to where it is held, too. What stands beside the segment is no part of it.
    """
    held = body.joints if segment in body.equipment_segments else body.tree_joints
    ends = [joint.parent_T_joint[:3, 3] for joint in held if joint.parent == segment and joint.type != "free"]
    return [end for end in ends or [_tip(body, segment)] if np.linalg.norm(end) > BONE_RADIUS_M]


def _tip(body: BodyModel, segment: str) -> Array:
    """(3,) where a segment without further joints is drawn to: along its long axis, as far as its cameras reach."""
    joint = body.joint_to_parent(segment)
    cameras = [body.mounts[camera].segment_T_camera[:3, 3] for camera in body.cameras_on(segment)]
    if joint is None or not cameras:
        return np.zeros(3)
    long_axis = np.eye(3)["xyz".index(joint.angle_axes[1])]
    reach = max((float(position @ long_axis) for position in cameras), key=abs)
    tip: Array = reach * long_axis
    return tip
