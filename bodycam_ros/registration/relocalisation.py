"""The pose of a lost camera in the map, without any prior (A 4.1).

Keypoints are matched to the whole map by their descriptors. pycolmap's LO-RANSAC works on the rays of our calibrated
cameras, so a fisheye image needs no pinhole.
"""

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.colmap_model import PIXEL_SHIFT, colmap_camera, pycolmap
from bodycam_ros.geometry import inverse
from bodycam_ros.registration.matching import unambiguous
from bodycam_ros.registration.reference_map import ReferenceMap

_RANSAC_PX = 3.0  # inlier threshold; the fit that follows tightens it
_RANSAC_MAX_TRIALS = 5000  # find 4 good matches among 85 % outliers
_RANSAC_SEED = 7  # two runs over one recording are identical
_MIN_INLIERS = 12  # chance agreement of wrong matches stays below this
_MAX_DISTANCE = 240.0  # between RootSIFT vectors of length 512, without a predicted place
_FEATURES = (
    400,
    1000,
)  # tried in turn: 300 give some 50 matches in an empty room, 4 where people fill half of the picture
_SURE_INLIERS = 30  # with so many no more features are tried


def find_pose(
    camera: CameraModel, reference_map: ReferenceMap, pixels: NDArray[np.float64], descriptors: NDArray[np.uint8]
) -> NDArray[np.float64] | None:
    """Pose world_T_camera (4, 4) by PnP within LO-RANSAC, or None where too few matches agree on one.

    Args:
        camera: its model.
        reference_map: the map.
        pixels, descriptors: (M, 2), (M, 128) keypoints, the strongest first.
    """
    best, most = None, _MIN_INLIERS - 1
    for count in _FEATURES:
        pose, inliers = _pose_by(camera, reference_map, pixels[:count], descriptors[:count])
        if inliers > most:
            best, most = pose, inliers
        if most >= _SURE_INLIERS or len(descriptors) <= count:
            break
    return best


def _pose_by(
    camera: CameraModel, reference_map: ReferenceMap, pixels: NDArray[np.float64], descriptors: NDArray[np.uint8]
) -> tuple[NDArray[np.float64] | None, int]:
    """Pose world_T_camera (4, 4) by keypoints (M, 2) and their descriptors (M, 128), and the matches that agree."""
    features, landmarks = match_by_descriptors(reference_map, descriptors)
    if len(features) < _MIN_INLIERS:
        return None, 0
    options = pycolmap.AbsolutePoseEstimationOptions()
    options.ransac.max_error = _RANSAC_PX
    options.ransac.max_num_trials = _RANSAC_MAX_TRIALS
    options.ransac.random_seed = _RANSAC_SEED
    points_world = np.asarray(reference_map.points_world[landmarks], np.float64)
    shifted = np.asarray(pixels[features], np.float64) + PIXEL_SHIFT
    found = pycolmap.estimate_absolute_pose(shifted, points_world, colmap_camera(camera), options)
    if found is None:
        return None, 0
    world_T_camera = inverse(np.vstack([found["cam_from_world"].matrix(), [0.0, 0.0, 0.0, 1.0]]))
    return world_T_camera, int(np.sum(found["inlier_mask"]))


def match_by_descriptors(
    reference_map: ReferenceMap, descriptors: NDArray[np.uint8]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Match features (M, 128) to landmarks by descriptors alone: rows of features and landmarks, each only once."""
    return unambiguous(*reference_map.visual_index.find_nearest(descriptors), _MAX_DISTANCE)
