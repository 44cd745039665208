"""Which landmark does a described track show: near its predicted place, or anywhere in the map."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.local_scale import scales_at
from bodycam_ros.kernels import as_bytes
from bodycam_ros.near_pairs import near_pairs
from bodycam_ros.registration.descriptor_kernels import squared_distances
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.settings import setting


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
        1000,
        limits=(20, 20000),
        reason="features looked up in the whole map, 12 right matches are needed; 300 bring some 50 in an empty room, "
        "4 where people fill half of the picture",
    )
    searched_lists: int = setting(
        8,
        limits=(1, 64),
        reason="of the map's index that are searched for a feature; 8 find 56 of the 60 landmarks that all find",
    )
    similar_places: int = setting(
        20,
        unit="photographs",
        limits=(1, 1000),
        reason="whose landmarks a lost camera is asked for before those of the whole map; with 10 a camera in 60 is "
        "found only then",
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
    candidates: NDArray[np.int64] | None = None,
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
        candidates: rows of all landmarks that may be in view, ascending; None asks all of the map.

    Returns:
        Rows of the matched features and, for each, the row of its landmark. No landmark is matched twice.
    """
    asked = np.arange(len(reference_map.points_world)) if candidates is None else candidates
    centre = world_T_camera[:3, 3]
    offsets = reference_map.points_world[asked] - centre
    squared_ranges = np.einsum("ij,ij->i", offsets, offsets)
    sizes = reference_map.landmark_sizes[asked]
    large_enough = sizes**2 * camera.fx**2 > settings.min_visible_scale_px**2 * squared_ranges
    projected, valid = camera.project(offsets[large_enough] @ world_T_camera[:3, :3])
    in_view = valid & camera.in_image(projected)
    visible, projected = asked[large_enough][in_view], projected[in_view]
    if len(visible) == 0 or len(pixels) == 0:
        return np.zeros(0, np.int64), np.zeros(0, np.int64)
    feature, near, _ = near_pairs(pixels, projected, radius_px)
    feature, look = _looks_of(reference_map.descriptor_landmark, feature, visible[near])
    landmark = reference_map.descriptor_landmark[look].astype(np.int64)

    offsets = reference_map.points_world[landmark] - centre
    distances = np.sqrt(np.einsum("ij,ij->i", offsets, offsets))
    cosines = -np.einsum("ij,ij->i", reference_map.descriptor_view[look], offsets) / distances
    shown = scales_at(camera, offsets @ world_T_camera[:3, 2] / distances)
    expected_scale = shown * reference_map.descriptor_size[look] / distances
    size_ratio = scales[feature] / np.maximum(expected_scale, 1e-9)
    alike = (size_ratio < settings.max_size_ratio) & (size_ratio > 1 / settings.max_size_ratio)
    alike &= cosines > np.cos(np.radians(settings.max_view_angle_deg))
    feature, look, landmark = feature[alike], look[alike], landmark[alike]
    known = as_bytes(reference_map.descriptors)
    distance = np.sqrt(squared_distances(as_bytes(descriptors), feature, known, look))
    return _unambiguous(feature, landmark, distance, settings.max_distance, settings.ratio)


def match_by_looks(
    reference_map: ReferenceMap,
    descriptors: NDArray[np.uint8],
    landmarks: NDArray[np.int64] | None,
    settings: MatchingSettings,
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Match features to landmarks by their descriptors alone; returns as above.

    Args:
        reference_map: the map, whose index is searched.
        descriptors: (M, 128) RootSIFT, the strongest first; a few dozen matches are enough to find a camera, so only
            the first ``max_features_lost`` are looked up.
        landmarks: (N,) rows of those that are asked for; None: all.
        settings: thresholds.
    """
    query = descriptors[: settings.max_features_lost]
    among = None
    if landmarks is not None:
        _, among = _looks_of(reference_map.descriptor_landmark, landmarks, landmarks)
    landmark, best, rival = reference_map.search.index.nearest(query, settings.searched_lists, among)
    good = np.flatnonzero((landmark >= 0) & (best < settings.max_distance_lost) & (best < settings.ratio * rival))
    return _one_feature_per_landmark(good, landmark[good], best[good])


def _looks_of(
    landmark_of_look: NDArray[np.integer], feature: NDArray[np.int64], landmark: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Pairs of feature and landmark as pairs of feature and each look of that landmark; looks ascend by landmark."""
    landmark = landmark.astype(landmark_of_look.dtype)  # or all looks would be converted
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


_FADES = 0.998  # what is left of a judgement an image later
_LEAST_SCALE = 1e-12  # far from the smallest float32


class LandmarkTrust:
    """Judgements of all landmarks of a map, which fade; an image costs as much as the landmarks that it asks.

    Args:
        count: of landmarks.
        forget: share that the latest image has in a judgement.

    Attributes:
        scaled: (L,) float32; times ``scale`` this is how much more than usual a landmark is trusted, from -0.5 (never
            found) to 0.5 (always).
        scale: the same for all landmarks.
    """

    def __init__(self, count: int, forget: float) -> None:
        self._forget = forget
        self.scaled = np.zeros(count, np.float32)
        self.scale = 1.0

    def learn(self, rows: NDArray[np.int64], found: NDArray[np.bool_]) -> None:
        """An image in which landmarks (N,) were asked for, and which of them were found; all others fade."""
        self.scale *= _FADES
        if self.scale < _LEAST_SCALE:
            self.scaled *= np.float32(self.scale)
            self.scale = 1.0
        judged = np.where(found, 0.5, -0.5) / self.scale
        self.scaled[rows] += self._forget * (judged - self.scaled[rows])
