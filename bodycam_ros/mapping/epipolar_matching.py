"""Features of images whose poses are known, matched in full: a tenth of the work of matching without poses.

The poses give the line of the other image on which a feature must lie. Only the few features near it are compared, and
repeated texture is no rival unless it lies there too.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.local_scale import scales_at
from bodycam_ros.geometry import Array, rotation_to_z
from bodycam_ros.kernels import as_bytes, as_rows
from bodycam_ros.mapping.epipolar_kernels import match_along_epipolars
from bodycam_ros.mapping.features import MAX_RATIO, ImageFeatures
from bodycam_ros.progress import Advance, in_parallel

_BAND_PX = 4.0  # of photographs from the epipolar line; poses of few features err by one or two
_MAX_DISTANCE = 260.0  # between RootSIFT vectors of length 512
_MAX_SIZE_RATIO = 2.0  # size of a feature against the one that the distance of the point predicts


@dataclass(frozen=True)
class PosedFeatures:
    """Features of one image with a known pose.

    Attributes:
        world_T_camera: (4, 4).
        focal_length: pixels per radian on the optical axis [px].
        rays_world: (N, 3) unit rays to the features, in the world's axes.
        sizes: (N,) SIFT sigma as an angle [rad].
        descriptors: (N, 128) uint8 RootSIFT.
    """

    world_T_camera: Array
    focal_length: float
    rays_world: Array
    sizes: Array
    descriptors: NDArray[np.uint8]


def pose_features(
    camera: CameraModel,
    world_T_camera: Array,
    pixels: NDArray[np.floating],
    sigmas: NDArray[np.floating],
    descriptors: NDArray[np.uint8],
) -> tuple[PosedFeatures, NDArray[np.bool_]]:
    """The features of an image within the lens's cone, and which of all (N,) these are.

    Args:
        camera: its model.
        world_T_camera: (4, 4) its pose.
        pixels, sigmas, descriptors: (N, 2), (N,) [px], (N, 128) of the features.
    """
    bearings, in_view = camera.unproject(pixels)
    bearings = bearings[in_view]
    posed = PosedFeatures(
        world_T_camera=world_T_camera,
        focal_length=float(np.sqrt(camera.fx * camera.fy)),
        rays_world=bearings @ world_T_camera[:3, :3].T,
        sizes=sigmas[in_view] / scales_at(camera, bearings[:, 2]),
        descriptors=descriptors[in_view],
    )
    return posed, in_view


def match_posed(
    images: tuple[PosedFeatures, PosedFeatures],
    rows: tuple[NDArray[np.int64], NDArray[np.int64]],
    band_px: float,
    max_ratio: float,
    max_distance: float,
) -> NDArray[np.int64]:
    """Match some features of two images along their epipolar lines: pairs (M, 2) of rows, none in two pairs.

    Args:
        images: of which the features are.
        rows: (N,), (K,) the features that may be matched.
        band_px: largest distance from the epipolar line [px].
        max_ratio: best to second best distance along the line (Lowe 2004).
        max_distance: between descriptors.
    """
    between = images[1].world_T_camera[:3, 3] - images[0].world_T_camera[:3, 3]
    if not between.any():
        return np.zeros((0, 2), np.int64)
    axes_world = rotation_to_z(between / np.linalg.norm(between))
    first, second = (
        (as_rows(image.rays_world[at] @ axes_world.T), as_rows(image.sizes[at]), as_bytes(image.descriptors[at]))
        for image, at in zip(images, rows, strict=True)
    )
    band = band_px / min(image.focal_length for image in images)
    found = match_along_epipolars(*first, *second, band, _MAX_SIZE_RATIO, max_ratio, max_distance)
    return np.column_stack([rows[0][found[:, 0]], rows[1][found[:, 1]]])


def match_known_poses(
    features: Sequence[ImageFeatures],
    cameras: Sequence[CameraModel],
    world_T_camera: Array,
    pairs: Sequence[tuple[int, int]],
    workers: int,
    advance: Advance,
) -> list[NDArray[np.uint32]]:
    """Match pairs of photographs along their epipolar lines.

    Args:
        features: of the K photographs.
        cameras: that took each.
        world_T_camera: (K, 4, 4) their poses.
        pairs: rows of the photographs.
        workers: threads.
        advance: called for each pair.

    Returns:
        for each pair (M, 2) rows of features that match.
    """
    posed, rows = [], []
    for image, camera, pose in zip(features, cameras, world_T_camera, strict=True):
        in_cone, kept = pose_features(camera, pose, image.pixels, image.sigmas, image.descriptors)
        posed.append(in_cone)
        rows.append(np.flatnonzero(kept))

    def match(pair: tuple[int, int]) -> NDArray[np.uint32]:
        i, j = pair
        every = np.arange(len(rows[i])), np.arange(len(rows[j]))
        found = match_posed((posed[i], posed[j]), every, _BAND_PX, MAX_RATIO, _MAX_DISTANCE)
        return np.column_stack([rows[i][found[:, 0]], rows[j][found[:, 1]]]).astype(np.uint32)

    return list(in_parallel(match, pairs, workers, advance))
