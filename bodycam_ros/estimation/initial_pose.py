"""Poses of a body of which some segments are measured: where its first state starts."""

from collections.abc import Collection

import numpy as np

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body_state import SegmentPose
from bodycam_ros.geometry import Array, inverse, nearest_rotation
from bodycam_ros.kinematics.joint_angles import JointLimits


def first_poses(body: BodyModel, evidence: Collection[SegmentPose], bent: float = 0.0) -> Array:
    """Poses (S, 4, 4) of a body of which some segments are measured; joints between these need not be closed.

    Args:
        body: segments and joints.
        evidence: the measured segments.
        bent: how far the other joints are from the N-pose, as a share of the way to the middle of their limits.
    """
    poses: dict[str, Array] = {}
    motion = np.broadcast_to(np.eye(4), (len(body.tree_joints), 4, 4)).copy()
    motion[:, :3, :3] = JointLimits(body).middle(bent)
    for measured in evidence:
        poses.setdefault(measured.segment, measured.world_T_segment)
    joints = tuple(zip(body.tree_joints, motion, strict=True))
    while len(poses) < len(body.segments):
        for joint, joint_T_moved in (*joints, *reversed(joints)):
            parent_T_child = joint.parent_T_joint @ joint_T_moved @ joint.joint_T_child
            if joint.parent in poses and joint.child not in poses:
                poses[joint.child] = poses[joint.parent] @ parent_T_child
            elif joint.child in poses and joint.parent not in poses:
                poses[joint.parent] = poses[joint.child] @ inverse(parent_T_child)
    all_poses = np.stack([poses[segment] for segment in body.segments])
    all_poses[:, :3, :3] = nearest_rotation(all_poses[:, :3, :3])
    return all_poses
