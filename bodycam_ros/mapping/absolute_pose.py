"""The pose of a lost camera: PnP within RANSAC over 2D-3D matches with many outliers (A 4.1).

pycolmap does it on the rays of our calibrated cameras, so a fisheye image needs no pinhole.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.mapping.colmap import estimate_absolute_pose
from bodycam_ros.settings import setting


@dataclass(frozen=True)
class AbsolutePoseSettings:
    """RANSAC of the absolute registration."""

    ransac_px: float = setting(
        3.0, unit="px", limits=(0.5, 20.0), reason="inlier threshold; the fit that follows tightens it"
    )
    ransac_min_inliers: int = setting(12, limits=(4, 500), reason="chance agreement of wrong matches stays below this")
    ransac_max_trials: int = setting(5000, limits=(100, 1_000_000), reason="finds 4 good matches among 85 % outliers")
    ransac_seed: int = setting(
        7, limits=(0, 2**31 - 1), reason="fixed, so that two runs over one recording are identical"
    )


def find_pose(
    camera: CameraModel,
    points_world: NDArray[np.floating],
    pixels: NDArray[np.floating],
    settings: AbsolutePoseSettings,
) -> NDArray[np.float64] | None:
    """world_T_camera (4, 4) that most of the matches agree on, or None when too few do."""
    found = estimate_absolute_pose(
        camera, points_world, pixels, settings.ransac_px, settings.ransac_max_trials, settings.ransac_seed
    )
    if found is None:
        return None
    world_T_camera, inliers = found
    return world_T_camera if inliers.sum() >= settings.ransac_min_inliers else None
