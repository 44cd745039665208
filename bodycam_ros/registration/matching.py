"""Which landmark does a described track show: near its predicted place, or anywhere in the map."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.local_scale import scales_at
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.settings import setting

_BLOCK = 4096


@dataclass(frozen=True)
class MatchingSettings:
    """How alike a track and a landmark must be."""

    radius_px: float = setting(
        4.0,
        unit="px",
        limits=(0.5, 50.0),
        reason="search around the projection when the frame's pose is fitted already",
    )
    lost_radius_px: float = setting(
        20.0, unit="px", limits=(2.0, 300.0), reason="the same when the pose is only extrapolated, or found by RANSAC"
    )
    min_visible_scale_px: float = setting(
        1.0,
        unit="px",
        limits=(0.0, 20.0),
        reason="a landmark whose feature would have a smaller sigma in this image cannot be detected in it",
    )
    max_distance: float = setting(
        260.0,
        limits=(50.0, 724.0),
        reason="between RootSIFT vectors of length 512; near the predicted place the place itself is evidence",
    )
    max_distance_lost: float = setting(240.0, limits=(50.0, 724.0), reason="the same for a search of the whole map")
    ratio: float = setting(
        0.85, limits=(0.3, 1.0), reason="best to second best distance among other landmarks (Lowe 2004)"
    )
    max_features_lost: int = setting(
        300,
        limits=(20, 20000),
        reason="features looked up in the whole map; 300 bring some 50 right matches, 12 are needed",
    )
    max_size_ratio: float = setting(
        2.0, limits=(1.1, 10.0), reason="seen size of the feature against the size that its landmark predicts"
    )
    max_view_angle_deg: float = setting(
        60.0,
        unit="deg",
        limits=(10.0, 180.0),
        reason="SIFT stands some 60 degrees of change between the photograph's view and ours",
    )


def match_near_prediction(
    reference_map: ReferenceMap,
    camera: CameraModel,
    world_T_camera: NDArray[np.float64],
    pixels: NDArray[np.floating],
    descriptors: NDArray[np.uint8],
    scales: NDArray[np.floating],
    radius_px: float,
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
        settings: thresholds.

    Returns:
        Rows of the matched features and, for each, the row of its landmark. No landmark is matched twice.
    """
    offsets = reference_map.points_world - world_T_camera[:3, 3]
    squared_distances = np.einsum("ij,ij->i", offsets, offsets)
    large_enough = reference_map.landmark_sizes**2 * camera.fx**2 > settings.min_visible_scale_px**2 * squared_distances
    candidates = np.flatnonzero(large_enough)
    projected, valid = camera.project(offsets[candidates] @ world_T_camera[:3, :3])
    in_view = valid & camera.in_image(projected)
    visible, projected = candidates[in_view], projected[in_view]
    if len(visible) == 0 or len(pixels) == 0:
        return np.zeros(0, np.int64), np.zeros(0, np.int64)
    near = cKDTree(pixels).sparse_distance_matrix(cKDTree(projected), radius_px, output_type="coo_matrix")
    feature, look = _looks_of(reference_map.descriptor_landmark, near.row.astype(np.int64), visible[near.col])
    landmark = reference_map.descriptor_landmark[look].astype(np.int64)

    distances = np.sqrt(squared_distances[landmark])
    cosines = -np.einsum("ij,ij->i", reference_map.descriptor_view[look], offsets[landmark]) / distances
    shown = scales_at(camera, offsets[landmark] @ world_T_camera[:3, 2] / distances)
    expected_scale = shown * reference_map.descriptor_size[look] / distances
    size_ratio = scales[feature] / np.maximum(expected_scale, 1e-9)
    alike = (size_ratio < settings.max_size_ratio) & (size_ratio > 1 / settings.max_size_ratio)
    alike &= cosines > np.cos(np.radians(settings.max_view_angle_deg))
    feature, look, landmark = feature[alike], look[alike], landmark[alike]
    difference = descriptors[feature].astype(np.float32) - reference_map.descriptors[look].astype(np.float32)
    distance = np.sqrt(np.einsum("ij,ij->i", difference, difference))
    return _unambiguous(feature, landmark, distance, settings.max_distance, settings.ratio)


def match_everywhere(
    reference_map: ReferenceMap, descriptors: NDArray[np.uint8], every_view: bool, settings: MatchingSettings
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Match features to the landmarks of the whole map by their descriptors alone; returns as above.

    Args:
        reference_map: the map.
        descriptors: (M, 128) RootSIFT, the strongest first; a few dozen matches are enough to find a camera, so only
            the first ``max_features_lost`` are looked up.
        every_view: compare with all descriptors of a landmark; else with the one from the nearest photograph, which is
            four times faster and finds three of four.
        settings: thresholds.
    """
    if len(descriptors) == 0 or len(reference_map.descriptors) == 0:
        return np.zeros(0, np.int64), np.zeros(0, np.int64)
    landmark_of_look = reference_map.descriptor_landmark.astype(np.int64)
    starts = np.flatnonzero(np.diff(landmark_of_look, prepend=-1))
    looks = np.arange(len(landmark_of_look)) if every_view else starts
    firsts = starts if every_view else np.arange(len(starts))
    query = descriptors[: settings.max_features_lost].astype(np.float32)
    rows = np.arange(len(query))
    best, rival = np.full((2, len(query)), np.inf, np.float32)
    landmark = np.zeros(len(query), np.int64)
    for first, last in _blocks(firsts, len(looks)):
        known = reference_map.descriptors[looks[first:last]].astype(np.float32)
        landmark_of_known = landmark_of_look[looks[first:last]]
        # Squared distances less the query's own length, which does not change which is nearest.
        squared = (-2.0 * query) @ known.T
        squared += np.einsum("ij,ij->i", known, known)
        nearest = np.argmin(squared, axis=1)
        best_here, landmark_here = squared[rows, nearest], landmark_of_known[nearest]
        # The other descriptors of the same landmark are no rivals of its best.
        row, own = _looks_of(landmark_of_known, rows, landmark_here)
        squared[row, own] = np.inf
        nearer = best_here < best
        rival = np.minimum(np.minimum(rival, squared.min(axis=1)), np.where(nearer, best, best_here))
        landmark = np.where(nearer, landmark_here, landmark)
        best = np.minimum(best, best_here)
    lengths = np.einsum("ij,ij->i", query, query)
    best, rival = np.sqrt(np.maximum(best + lengths, 0)), np.sqrt(np.maximum(rival + lengths, 0))
    good = (best < settings.max_distance_lost) & (best < settings.ratio * rival)
    return _one_feature_per_landmark(rows[good], landmark[good], best[good])


def _blocks(firsts: NDArray[np.int64], count: int) -> Iterator[tuple[int, int]]:
    """Ranges of looks, each of whole landmarks, whose distances fit into a processor's cache.

    Args:
        firsts: the first look of every landmark.
        count: of looks.
    """
    edges = firsts[np.searchsorted(firsts, np.arange(0, count, _BLOCK), side="right") - 1].tolist()
    edges = sorted({*edges, count})
    yield from pairwise(edges)


def _looks_of(
    landmark_of_look: NDArray[np.integer], feature: NDArray[np.int64], landmark: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Pairs of feature and landmark as pairs of feature and each look of that landmark; looks ascend by landmark."""
    first = np.searchsorted(landmark_of_look, landmark, side="left")
    count = np.searchsorted(landmark_of_look, landmark, side="right") - first
    start_of_pair = np.cumsum(count) - count
    look = np.arange(count.sum()) - np.repeat(start_of_pair - first, count)
    return np.repeat(feature, count), look


def _unambiguous(
    feature: NDArray[np.int64],
    landmark: NDArray[np.int64],
    distance: NDArray[np.floating],
    max_distance: float,
    ratio: float,
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
