"""Poses of a lost camera in the map, without any prior (A 4.1).

Keypoints are matched to the landmarks of similar photographs, then to the whole map. pycolmap's LO-RANSAC works on the
rays of our calibrated cameras, so a fisheye image needs no pinhole.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.colmap_model import PIXEL_SHIFT, colmap_camera, pycolmap
from bodycam_ros.geometry import inverse
from bodycam_ros.registration.matching import RATIO, one_feature_per_landmark
from bodycam_ros.registration.reference_map import ReferenceMap

_RANSAC_PX = 3.0  # inlier threshold; the fit that follows tightens it
_RANSAC_MAX_TRIALS = 5000  # find 4 good matches among 85 % outliers
_RANSAC_SEED = 7  # two runs over one recording are identical
_MIN_INLIERS = 12  # chance agreement of wrong matches stays below this
_MAX_DISTANCE = 240.0  # between RootSIFT vectors of length 512, without a predicted place
_MOST_FEATURES = 1000  # 300 give some 50 matches in an empty room, 4 where people fill half of the picture


def find_poses(
    camera: CameraModel, reference_map: ReferenceMap, pixels: NDArray[np.float64], descriptors: NDArray[np.uint8]
) -> Iterator[NDArray[np.float64]]:
    """Poses world_T_camera (4, 4) that the image supports, the likeliest first; each is computed when it is asked for.

    Args:
        camera: its model.
        reference_map: the map.
        pixels, descriptors: (M, 2), (M, 128) keypoints, the strongest first.
    """
    query, index = descriptors[:_MOST_FEATURES], reference_map.visual_index
    similar = index.find_similar(query)
    for allowed in (None,) if similar is None else (similar, None):
        features, landmarks = match_by_descriptors(reference_map, query, allowed)
        pose = solve_pose(camera, reference_map.points_world[landmarks], pixels[features])
        if pose is not None:
            yield pose


def match_by_descriptors(
    reference_map: ReferenceMap, descriptors: NDArray[np.uint8], allowed: NDArray[np.bool_] | None = None
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Match features (M, 128) to landmarks by descriptors alone.

    Args:
        reference_map: the map.
        descriptors: (M, 128) RootSIFT.
        allowed: (L,) landmarks that may be matched; None: all.

    Returns:
        Rows of the matched features and, for each, its landmark. No landmark is matched twice.
    """
    landmark, best, rival = reference_map.visual_index.find_nearest(descriptors, allowed)
    good = np.flatnonzero((landmark >= 0) & (best < _MAX_DISTANCE) & (best < RATIO * rival))
    return one_feature_per_landmark(good, landmark[good], best[good])


def solve_pose(
    camera: CameraModel, points_world: NDArray[np.floating], pixels: NDArray[np.floating]
) -> NDArray[np.float64] | None:
    """PnP within LO-RANSAC on the camera's rays: world_T_camera (4, 4), or None where too few matches agree on one.

    Args:
        camera: of any model.
        points_world: (N, 3) [m].
        pixels: (N, 2) their places in the image.
    """
    if len(pixels) < _MIN_INLIERS:
        return None
    options = pycolmap.AbsolutePoseEstimationOptions()
    options.ransac.max_error = _RANSAC_PX
    options.ransac.max_num_trials = _RANSAC_MAX_TRIALS
    options.ransac.random_seed = _RANSAC_SEED
    found = pycolmap.estimate_absolute_pose(
        np.asarray(pixels, np.float64) + PIXEL_SHIFT,
        np.asarray(points_world, np.float64),
        colmap_camera(camera),
        options,
    )
    if found is None or np.sum(found["inlier_mask"]) < _MIN_INLIERS:
        return None
    return inverse(np.vstack([found["cam_from_world"].matrix(), [0.0, 0.0, 0.0, 1.0]]))
