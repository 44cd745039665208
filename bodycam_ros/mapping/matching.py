"""Which landmark does a described track show: near its predicted place, or anywhere in the map."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from bodycam_ros.camera import CameraModel
from bodycam_ros.mapping.reference_map import ReferenceMap
from bodycam_ros.settings import setting

_FEATURE_BLOCK = 32
"""Features compared at a time in a search of the whole map: 32 against 100 000 descriptors make 13 MB."""


@dataclass(frozen=True)
class MatchingSettings:
    """How alike a track and a landmark must be."""

    radius_px: float = setting(4.0, unit="px", limits=(0.5, 50.0), reason="search around the projection when the frame's pose is fitted already")
    lost_radius_px: float = setting(40.0, unit="px", limits=(2.0, 300.0), reason="search around the projection when the pose is only extrapolated")
    max_distance: float = setting(
        260.0, limits=(50.0, 724.0), reason="between RootSIFT vectors of length 512; near the predicted place the place itself is evidence"
    )
    max_distance_lost: float = setting(230.0, limits=(50.0, 724.0), reason="the same for a search of the whole map")
    ratio: float = setting(0.85, limits=(0.3, 1.0), reason="best to second best distance among other landmarks (Lowe 2004)")
    max_size_ratio: float = setting(2.0, limits=(1.1, 10.0), reason="seen size of the feature against the size that its landmark predicts")
    max_view_angle_deg: float = setting(
        60.0, unit="deg", limits=(10.0, 180.0), reason="SIFT stands some 60 degrees of change between the photograph's view and ours"
    )


def match_near_prediction(
    reference_map: ReferenceMap,
    camera: CameraModel,
    world_T_camera: NDArray[np.float64],
    pixels: NDArray[np.floating],
    descriptors: NDArray[np.uint8],
    scales: NDArray[np.floating],
    radius_px: float,
    taken: NDArray[np.int64],
    settings: MatchingSettings,
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Match features to the landmarks that project near them.

    Args:
        reference_map: the map.
        camera, world_T_camera: where the landmarks are looked from.
        pixels: (M, 2) features.
        descriptors: (M, 128) their RootSIFT.
        scales: (M,) their sigma [px].
        radius_px: how far from its projection a landmark may show.
        taken: rows of landmarks that other tracks carry already.
        settings: thresholds.

    Returns:
        Rows of the matched features and, for each, the row of its landmark. No landmark is matched twice.
    """
    looks = reference_map.descriptor_landmark.astype(np.int64)
    offsets = reference_map.points_world - world_T_camera[:3, 3]
    distances = np.linalg.norm(offsets, axis=1)
    projected, valid = camera.project(offsets @ world_T_camera[:3, :3])
    valid = valid & camera.in_image(projected)
    valid[taken] = False
    towards_camera = -offsets / np.maximum(distances, 1e-9)[:, None]
    facing = np.einsum("ij,ij->i", reference_map.descriptor_view, towards_camera[looks]) > np.cos(
        np.radians(settings.max_view_angle_deg)
    )
    usable = np.flatnonzero(facing & valid[looks])
    if len(usable) == 0 or len(pixels) == 0:
        return np.zeros(0, np.int64), np.zeros(0, np.int64)

    pairs = cKDTree(pixels).sparse_distance_matrix(cKDTree(projected[looks[usable]]), radius_px, output_type="coo_matrix")
    feature, look = pairs.row.astype(np.int64), usable[pairs.col]
    landmark = looks[look]
    expected_scale = camera.fx * reference_map.descriptor_size[look] / distances[landmark]
    size_ratio = scales[feature] / np.maximum(expected_scale, 1e-9)
    alike_in_size = (size_ratio < settings.max_size_ratio) & (size_ratio > 1 / settings.max_size_ratio)
    feature, look, landmark = feature[alike_in_size], look[alike_in_size], landmark[alike_in_size]
    difference = descriptors[feature].astype(np.float32) - reference_map.descriptors[look].astype(np.float32)
    distance = np.sqrt(np.einsum("ij,ij->i", difference, difference))
    return _unambiguous(feature, landmark, distance, settings.max_distance, settings.ratio)


def match_everywhere(
    reference_map: ReferenceMap, descriptors: NDArray[np.uint8], settings: MatchingSettings
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Match features (M, 128) to the landmarks of the whole map by their descriptors alone; returns as above."""
    if len(descriptors) == 0 or len(reference_map.descriptors) == 0:
        return np.zeros(0, np.int64), np.zeros(0, np.int64)
    looks = reference_map.descriptors.astype(np.float32)
    look_norms = np.einsum("ij,ij->i", looks, looks)
    first_look = np.flatnonzero(np.diff(reference_map.descriptor_landmark.astype(np.int64), prepend=-1))
    landmark_of_group = reference_map.descriptor_landmark[first_look].astype(np.int64)
    best_group = np.zeros(len(descriptors), np.int64)
    best, second = np.zeros((2, len(descriptors)))
    for start in range(0, len(descriptors), _FEATURE_BLOCK):
        query = descriptors[start : start + _FEATURE_BLOCK].astype(np.float32)
        squared = np.einsum("ij,ij->i", query, query)[:, None] - 2 * query @ looks.T + look_norms
        # The looks of one landmark are no rivals of each other.
        by_landmark = np.minimum.reduceat(squared, first_look, axis=1)
        block = slice(start, start + len(query))
        rows = np.arange(len(query))
        best_group[block] = np.argmin(by_landmark, axis=1)
        best[block] = by_landmark[rows, best_group[block]]
        by_landmark[rows, best_group[block]] = np.inf
        second[block] = by_landmark.min(axis=1)
    best, second = np.sqrt(np.maximum(best, 0)), np.sqrt(np.maximum(second, 0))
    good = np.flatnonzero((best < settings.max_distance_lost) & (best < settings.ratio * second))
    return _one_feature_per_landmark(good, landmark_of_group[best_group[good]], best[good])


def _unambiguous(
    feature: NDArray[np.int64], landmark: NDArray[np.int64], distance: NDArray[np.floating], max_distance: float, ratio: float
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Per feature the landmark with the least distance, unless another landmark is nearly as like it."""
    order = np.lexsort((distance, feature))
    feature, landmark, distance = feature[order], landmark[order], distance[order]
    first = np.flatnonzero(np.diff(feature, prepend=-1))
    group = np.cumsum(np.diff(feature, prepend=-1) != 0) - 1
    rival_distance = np.where(landmark == landmark[first][group], np.inf, distance)
    rival = np.minimum.reduceat(rival_distance, first) if len(first) else rival_distance
    good = (distance[first] < max_distance) & (distance[first] < ratio * rival)
    return _one_feature_per_landmark(feature[first][good], landmark[first][good], distance[first][good])


def _one_feature_per_landmark(
    feature: NDArray[np.int64], landmark: NDArray[np.int64], distance: NDArray[np.floating]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    order = np.lexsort((distance, landmark))
    kept = np.sort(order[np.diff(landmark[order], prepend=-1) != 0])
    return feature[kept], landmark[kept]
