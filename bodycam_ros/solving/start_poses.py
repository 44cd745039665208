"""Where the segments of a new instant start, before the solver moves them."""

from collections.abc import Collection, Mapping

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.geometry import exp_so3, inverse, log_so3, rigid
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.solving.camera_evidence import SegmentPose
from bodycam_ros.solving.expected_joints import ExpectedJoints
from bodycam_ros.solving.motion import orthonormal

Array = NDArray[np.float64]


def first_poses(body: BodyModel, evidence: Collection[SegmentPose]) -> Array:
    """Poses (S, 4, 4) of a body that begins: segments where their cameras are (A 4.2), the others as in the N-pose."""
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
    return orthonormal(np.stack([poses[segment] for segment in body.segments]))


def led(rotations: Array, before: Array, expected: ExpectedJoints) -> Array:
    """Joint rotations (J, 3, 3) in which unseen joints move with their expectation, as far as it leads them.

    Args:
        rotations: (J, 3, 3) where they would go by themselves.
        before: (J, 3, 3) where they were at the instant before.
        expected: how their expectation moved since then.
    """
    rows = expected.rows
    towards = log_so3(np.swapaxes(rotations[rows], -1, -2) @ before[rows] @ expected.steps)
    turned = rotations.copy()
    turned[rows] = rotations[rows] @ exp_so3(expected.lead[:, None] * towards)
    return turned


def hung(body: BodyModel, poses: Array, rotations: Array, known: NDArray[np.bool_]) -> Array:
    """Poses (S, 4, 4) in which every segment that is not known (S,) hangs on its joint, turned by it (J, 3, 3)."""
    return orthonormal(body.hang(poses, rotations, known))


def seated(path: Array, seats: Mapping[int, Array]) -> Array:
    """Start values (S, 4, 4): the path, except for segments that start where their cameras are, row -> pose (4, 4)."""
    start = path.copy()
    if seats:
        start[list(seats)] = orthonormal(np.stack(list(seats.values())))
    return start


def turned_on_joint(body: BodyModel, matches: LandmarkMatches, evidence: Collection[SegmentPose], path: Array) -> Array:
    """The pose (4, 4) of a refused camera's segment: turned as the camera says, but where its joint is.

    Far landmarks fix a rotation well and a position badly, so a wrong registration is often half right.

    Args:
        body: joints and mounts.
        matches: the refused registration.
        evidence: the registrations that are believed.
        path: (S, 4, 4) where the segments should be.
    """
    mount = body.mounts[matches.camera]
    joint = body.joint_to_parent(mount.segment)
    if joint is None or matches.world_T_camera is None:
        return np.asarray(path[body.segment_index[mount.segment]])
    parents = [seen.world_T_segment for seen in evidence if seen.segment == joint.parent]
    world_T_parent = parents[0] if parents else path[body.segment_index[joint.parent]]
    world_T_joint = world_T_parent @ joint.parent_T_joint
    world_R_segment = (matches.world_T_camera @ inverse(mount.segment_T_camera))[:3, :3]
    return rigid(world_R_segment, world_T_joint[:3, 3] - world_R_segment @ joint.child_T_joint[:3, 3])
