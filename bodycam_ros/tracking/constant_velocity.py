"""Where a camera will be if it keeps moving as it did: the velocity counts, for images are missing now and then."""

import numpy as np

from bodycam_ros.geometry import Array, exp_se3, inverse, log_se3, nearest_rotation, rigid

LONGEST_NS = 500_000_000
"""Nobody keeps a velocity for longer: from then on a prediction stands still."""


def camera_velocity(world_T_earlier: Array, world_T_camera: Array, passed_ns: int) -> Array:
    """(6,) twist in camera axes [rad/s, m/s] that brings a camera from one pose to another in the time passed [ns]."""
    return np.asarray(log_se3(inverse(world_T_earlier) @ world_T_camera) / (1e-9 * passed_ns))


def predict_pose(world_T_camera: Array, velocity: Array, passed_ns: int, later_R_camera: Array | None = None) -> Array:
    """The pose (4, 4) after some time.

    Args:
        world_T_camera: (4, 4) the pose.
        velocity: (6,) of ``camera_velocity`` [rad/s, m/s].
        passed_ns: how much later [ns].
        later_R_camera: (3, 3) rotation since then where it was measured (A eq. 2).
    """
    camera_T_later = exp_se3(1e-9 * min(passed_ns, LONGEST_NS) * velocity)
    if later_R_camera is not None:
        camera_T_later = rigid(later_R_camera.T, camera_T_later[:3, 3])
    predicted = world_T_camera @ camera_T_later
    return rigid(nearest_rotation(predicted[:3, :3]), predicted[:3, 3])  # or rounding doubles with every image
