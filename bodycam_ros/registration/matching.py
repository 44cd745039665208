"""Matches described tracks to the landmarks that project near them."""

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.local_scale import scales_at
from bodycam_ros.kernels import as_bytes
from bodycam_ros.registration.descriptor_kernels import search_lists
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.tracking.near_pairs import near_pairs

RADIUS_PX = 4.0  # around the projection by a fitted pose
WIDE_RADIUS_PX = 20.0  # around the projection by a predicted pose, or one of RANSAC
MIN_VISIBLE_SCALE_PX = 1.0  # a feature of a smaller sigma in the image cannot be detected in it
MAX_VIEW_ANGLE_DEG = 60.0  # SIFT stands some 60 degrees of change between the photograph's view and ours
_RATIO = 0.85  # best to second best distance among other landmarks (Lowe 2004)
_MAX_DISTANCE = 260.0  # between RootSIFT vectors of length 512; near the predicted place the place is evidence too
_MAX_SIZE_RATIO = 2.0  # size of the feature against the size that its landmark predicts

_NO_MATCH = np.zeros(0, np.int64), np.zeros(0, np.int64)


def match_near_prediction(
    reference_map: ReferenceMap,
    camera: CameraModel,
    world_T_camera: NDArray[np.float64],
    pixels: NDArray[np.floating],
    descriptors: NDArray[np.uint8],
    scales: NDArray[np.floating],
    radius_px: float,
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Match features to the landmarks that project near them.

    Args:
        reference_map: the map.
        camera, world_T_camera: projection of the landmarks.
        pixels: (M, 2) features.
        descriptors: (M, 128) their RootSIFT.
        scales: (M,) their sigma [px].
        radius_px: largest distance of a feature from the projection of its landmark.

    Returns:
        Rows of the matched features and, for each, the row of its landmark. No landmark is matched twice.
    """
    centre = world_T_camera[:3, 3]
    offsets = reference_map.points_world - centre
    squared_ranges = np.einsum("ij,ij->i", offsets, offsets)
    large_enough = reference_map.landmark_sizes**2 * camera.fx**2 > MIN_VISIBLE_SCALE_PX**2 * squared_ranges
    projected, valid = camera.project(offsets[large_enough] @ world_T_camera[:3, :3])
    in_view = valid & camera.in_image(projected)
    visible, projected = np.flatnonzero(large_enough)[in_view], projected[in_view]
    if len(visible) == 0 or len(pixels) == 0:
        return _NO_MATCH
    feature, near, _ = near_pairs(pixels, projected, radius_px)
    feature, described = _descriptors_of(reference_map.descriptor_landmark, feature, visible[near])
    landmark = reference_map.descriptor_landmark[described].astype(np.int64)

    offsets = reference_map.points_world[landmark] - centre
    distances = np.sqrt(np.einsum("ij,ij->i", offsets, offsets))
    cosines = -np.einsum("ij,ij->i", reference_map.descriptor_view[described], offsets) / distances
    px_per_rad = scales_at(camera, offsets @ world_T_camera[:3, 2] / distances)
    expected_scale = px_per_rad * reference_map.descriptor_size[described] / distances
    size_ratio = scales[feature] / np.maximum(expected_scale, 1e-9)
    similar = (size_ratio < _MAX_SIZE_RATIO) & (size_ratio > 1 / _MAX_SIZE_RATIO)
    similar &= cosines > np.cos(np.radians(MAX_VIEW_ANGLE_DEG))
    # Every feature has a list of its own.
    first = np.searchsorted(feature[similar], np.arange(len(pixels) + 1))
    lists = np.arange(len(pixels))[:, None]
    known = as_bytes(reference_map.descriptors), reference_map.descriptor_landmark
    return unambiguous(*search_lists(as_bytes(descriptors), lists, first, described[similar], *known), _MAX_DISTANCE)


def _descriptors_of(
    landmark_of_descriptor: NDArray[np.integer], feature: NDArray[np.int64], landmark: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Pairs of feature and landmark as pairs of feature and each descriptor of that landmark."""
    landmark = landmark.astype(landmark_of_descriptor.dtype)  # or the whole table would be converted
    first = np.searchsorted(landmark_of_descriptor, landmark, side="left")
    count = np.searchsorted(landmark_of_descriptor, landmark, side="right") - first
    start_of_pair = np.cumsum(count) - count
    described = np.arange(count.sum()) - np.repeat(start_of_pair - first, count)
    return np.repeat(feature, count), described


def unambiguous(
    landmark: NDArray[np.int64], squared: NDArray[np.int64], rival: NDArray[np.int64], max_distance: float
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Rows of features and of their landmarks, each only once, without those that another landmark resembles too.

    Args:
        landmark, squared, rival: (M,) of the features, as of ``search_lists``.
        max_distance: between descriptors.
    """
    distance = np.sqrt(squared)
    feature = np.flatnonzero((landmark >= 0) & (distance < max_distance) & (distance < _RATIO * np.sqrt(rival)))
    order = feature[np.lexsort((distance[feature], landmark[feature]))]
    kept = np.sort(order[np.diff(landmark[order], prepend=-1) != 0])
    return kept, landmark[kept]
