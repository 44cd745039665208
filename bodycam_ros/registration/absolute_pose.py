"""The pose of a lost camera: PnP within RANSAC over 2D-3D matches with many outliers (A 4.1).

pycolmap does it on the rays of our calibrated cameras, so a fisheye image needs no pinhole.
"""

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.colmap_camera import PIXEL_SHIFT, colmap_camera, pycolmap
from bodycam_ros.geometry import inverse
from bodycam_ros.registration.absolute_pose_settings import AbsolutePoseSettings


def find_pose(
    camera: CameraModel,
    points_world: NDArray[np.floating],
    pixels: NDArray[np.floating],
    settings: AbsolutePoseSettings,
) -> NDArray[np.float64] | None:
    """PnP within LO-RANSAC on the camera's rays: world_T_camera (4, 4), or None when too few matches agree on one.

    Args:
        camera: of any model.
        points_world: (N, 3) [m].
        pixels: (N, 2) where the image shows them.
        settings: of the sampling.
    """
    options = pycolmap.AbsolutePoseEstimationOptions()
    options.ransac.max_error = settings.ransac_px
    options.ransac.max_num_trials = settings.ransac_max_trials
    options.ransac.random_seed = settings.ransac_seed
    found = pycolmap.estimate_absolute_pose(
        np.asarray(pixels, np.float64) + PIXEL_SHIFT,
        np.asarray(points_world, np.float64),
        colmap_camera(camera),
        options,
    )
    if found is None or np.sum(found["inlier_mask"]) < settings.ransac_min_inliers:
        return None
    return inverse(np.vstack([found["cam_from_world"].matrix(), [0.0, 0.0, 0.0, 1.0]]))
