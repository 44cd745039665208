"""Which descriptors a landmark keeps, and what it takes to know them again from elsewhere."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera.local_scale import scales_at
from bodycam_ros.mapping.features import ImageFeatures
from bodycam_ros.mapping.structure import NO_FEATURE, Structure
from bodycam_ros.settings import setting


@dataclass(frozen=True)
class DescriptorSettings:
    """How many descriptors a landmark carries."""

    per_landmark: int = setting(
        4, limits=(1, 50), reason="spread over the directions of view: SIFT holds for some 30 degrees around each"
    )


@dataclass(frozen=True)
class LandmarkDescriptors:
    """Descriptors, grouped by landmark.

    Attributes:
        landmark: (D,) uint32 row of the landmark, ascending.
        descriptors: (D, 128) uint8 RootSIFT.
        view: (D, 3) float32 unit direction, in the world, from the landmark to the camera that gave it.
        size: (D,) float32 size of the feature [m]: its sigma [px] times distance over the pixels
            per radian that the lens has there.
    """

    landmark: NDArray[np.uint32]
    descriptors: NDArray[np.uint8]
    view: NDArray[np.float32]
    size: NDArray[np.float32]


def choose_descriptors(
    structure: Structure, features: Sequence[ImageFeatures], settings: DescriptorSettings
) -> LandmarkDescriptors:
    """Pick each landmark's descriptors so that they spread over the directions that it was seen from.

    Args:
        structure: in the frame of the map.
        features: of the photographs of ``structure``, in its order.
        settings: how many to keep.
    """
    known = structure.observation_features != NO_FEATURE
    points_camera = structure.observed_points_camera()
    distances = np.linalg.norm(points_camera, axis=1)
    to_camera = structure.world_T_camera[structure.observation_views, :3, 3]
    to_camera = (to_camera - structure.points_world[structure.observation_points]) / distances[:, None]

    # By landmark, and within it the nearest view first: it has the sharpest and largest image.
    order = np.lexsort((distances, structure.observation_points))
    order = order[known[order]]
    landmarks = structure.observation_points[order]
    starts = np.flatnonzero(np.diff(landmarks, prepend=-1))
    kept = [
        group[_spread(to_camera[group], settings.per_landmark)] for group in np.split(order, starts[1:]) if len(group)
    ]
    chosen = np.concatenate(kept) if kept else np.zeros(0, dtype=np.int64)

    views, rows = structure.observation_views[chosen], structure.observation_features[chosen]
    descriptors = np.zeros((len(chosen), 128), dtype=np.uint8)
    sigmas = np.zeros(len(chosen))
    for view, image in enumerate(features):
        here = views == view
        descriptors[here] = image.descriptors[rows[here]]
        sigmas[here] = image.sigmas[rows[here]]
    scales = _local_scales(structure, points_camera)[chosen]
    return LandmarkDescriptors(
        landmark=structure.observation_points[chosen].astype(np.uint32),
        descriptors=descriptors,
        view=to_camera[chosen].astype(np.float32),
        size=(sigmas * distances[chosen] / scales).astype(np.float32),
    )


def _local_scales(structure: Structure, points_camera: NDArray[np.float64]) -> NDArray[np.float64]:
    """(O,) pixels per radian where each observation is seen."""
    cosines = points_camera[:, 2] / np.linalg.norm(points_camera, axis=1)
    scales = np.empty(len(points_camera))
    for camera, seen in structure.observations_by_camera():
        scales[seen] = scales_at(camera, cosines[seen])
    return scales


def _spread(directions: NDArray[np.float64], count: int) -> NDArray[np.int64]:
    """Rows of up to ``count`` of the unit directions (N, 3), each the farthest from those before it."""
    chosen = [0]
    cosines = directions @ directions[0]
    while len(chosen) < min(count, len(directions)):
        following = int(cosines.argmin())
        chosen.append(following)
        cosines = np.maximum(cosines, directions @ directions[following])
        cosines[chosen] = np.inf
    return np.array(chosen, dtype=np.int64)
