"""Registrations of a body in the N-pose that moves steadily along x."""

from collections.abc import Iterator

import numpy as np

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.geometry import rigid
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from helpers.registered_pose import registered_pose

FRAME_NS = 33_333_333
START_NS = 10_000_000_000_000
SPEED = 0.5  # m/s, along x
STICK_IN_TORSO = np.array([0.0, 0.2, 0.1])
"""The arm hangs from 0.2 m left and 0.4 m up, and holds equipment 0.3 m below."""


def registrations(body: BodyModel, frames: range) -> Iterator[LandmarkMatches]:
    """Registrations of all cameras in some frames."""
    for frame in frames:
        stamp = START_NS + frame * FRAME_NS
        world_T_root = rigid(np.eye(3), np.array([SPEED * 1e-9 * (stamp - START_NS), 0.0, 1.0]))
        joint_poses = np.tile(np.eye(4), (len(body.tree_joints), 1, 1))
        for row, joint in enumerate(body.tree_joints):
            if joint.type == "free":
                joint_poses[row, :3, 3] = STICK_IN_TORSO
        world_T_segment = body.forward_kinematics(world_T_root, joint_poses)
        for camera, mount in body.mounts.items():
            yield registered_pose(
                camera,
                stamp,
                stamp - FRAME_NS if frame else 0,
                world_T_segment[body.segment_index[mount.segment]] @ mount.segment_T_camera,
            )
