"""A registration of an image with the camera's pose and nothing else."""

import numpy as np

from bodycam_ros.geometry import Array
from bodycam_ros.registration.landmark_matches import LandmarkMatches


def registered_pose(
    camera: str, stamp_ns: int, previous_ns: int, world_T_camera: Array | None, covariance: Array | None = None
) -> LandmarkMatches:
    """The pose, or None where it is lost; to a millimetre and a milliradian unless ``covariance`` (6, 6) is given."""
    return LandmarkMatches(
        camera=camera,
        stamp_ns=stamp_ns,
        previous_stamp_ns=previous_ns,
        track_ids=np.zeros(0, np.uint32),
        landmark_ids=np.zeros(0, np.uint32),
        pixels=np.zeros((0, 2), np.float32),
        points_world=np.zeros((0, 3), np.float32),
        world_T_camera=world_T_camera,
        pose_covariance=np.eye(6) * 1e-6 if covariance is None else covariance,
        current_R_previous=np.eye(3),
        rotation_inliers=0,
    )
