"""Reprojection errors of landmarks."""

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel


def reprojection_errors(
    camera: CameraModel,
    points_world: NDArray[np.floating],
    pixels: NDArray[np.floating],
    world_T_camera: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Reprojection errors (N,) [px] of landmarks (N, 3); infinite where they are out of view."""
    projected, valid = camera.project((points_world - world_T_camera[:3, 3]) @ world_T_camera[:3, :3])
    return np.where(valid, np.linalg.norm(projected - pixels, axis=1), np.inf)
