"""Where the segments of a body are that begins: with their cameras (A 4.2), the others as in the N-pose."""

from collections.abc import Collection

import numpy as np

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body_state import SegmentPose
from bodycam_ros.geometry import Array, inverse, nearest_rotation


def first_poses(body: BodyModel, evidence: Collection[SegmentPose]) -> Array:
    """Poses (S, 4, 4) of a body of which some segments are seen; joints between these need not be closed."""
    poses: dict[str, Array] = {}
    for seen in evidence:
        poses.setdefault(seen.segment, seen.world_T_segment)
    joints = body.tree_joints
    while len(poses) < len(body.segments):
        for joint in (*joints, *reversed(joints)):
            parent_T_child = joint.parent_T_joint @ joint.joint_T_child
            if joint.parent in poses and joint.child not in poses:
                poses[joint.child] = poses[joint.parent] @ parent_T_child
            elif joint.child in poses and joint.parent not in poses:
                poses[joint.parent] = poses[joint.child] @ inverse(parent_T_child)
    all_poses = np.stack([poses[segment] for segment in body.segments])
    all_poses[:, :3, :3] = nearest_rotation(all_poses[:, :3, :3])
    return all_poses
