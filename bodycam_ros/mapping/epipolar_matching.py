"""Pairs of photographs whose poses are nearly known, matched in full: a tenth of the work of matching without poses.

The poses give the line of the other photograph on which a feature must lie. Only the few features near it are compared,
and repeated texture is no rival unless it lies there too.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.local_scale import scales_at
from bodycam_ros.kernels import as_rows
from bodycam_ros.mapping.epipolar_kernels import match_along_epipolars
from bodycam_ros.mapping.features import MAX_RATIO, ImageFeatures
from bodycam_ros.mapping.progress import Advance, in_parallel

_BAND_PX = 4.0  # from the epipolar line; poses of few features err by one or two
_MAX_DISTANCE = 260.0  # between RootSIFT vectors of length 512
_MAX_SIZE_RATIO = 2.0  # size of a feature against the one that the distance of the point predicts


@dataclass(frozen=True)
class _PosedFeatures:
    """Features with their rays in the world: (N, 3), (N,) sizes [rad], (N, 128), and their rows in the photograph."""

    rays_world: NDArray[np.float64]
    sizes: NDArray[np.float64]
    descriptors: NDArray[np.uint8]
    rows: NDArray[np.int64]
    centre: NDArray[np.float64]
    focal_length: float


def match_known_poses(
    features: Sequence[ImageFeatures],
    cameras: Sequence[CameraModel],
    world_T_camera: NDArray[np.float64],
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
    posed = [_posed(*photograph) for photograph in zip(features, cameras, world_T_camera, strict=True)]
    matches = []
    for found in in_parallel(lambda pair: _match(posed[pair[0]], posed[pair[1]]), pairs, workers):
        matches.append(found)
        advance()
    return matches


def _posed(image: ImageFeatures, camera: CameraModel, pose: NDArray[np.float64]) -> _PosedFeatures:
    rays, valid = camera.unproject(image.pixels)
    rows = np.flatnonzero(valid)
    return _PosedFeatures(
        rays_world=rays[rows] @ pose[:3, :3].T,
        sizes=image.sigmas[rows] / scales_at(camera, rays[rows, 2]),
        descriptors=np.require(image.descriptors[rows], np.uint8, ("C", "W")),
        rows=rows,
        centre=pose[:3, 3],
        focal_length=camera.fx,
    )


def _match(first: _PosedFeatures, second: _PosedFeatures) -> NDArray[np.uint32]:
    baseline = second.centre - first.centre
    distance = float(np.linalg.norm(baseline))
    if distance == 0.0:
        return np.zeros((0, 2), np.uint32)
    axes_world = axes_along(baseline / distance)
    found = match_along_epipolars(
        as_rows(first.rays_world @ axes_world.T),
        first.sizes,
        first.descriptors,
        as_rows(second.rays_world @ axes_world.T),
        second.sizes,
        second.descriptors,
        _BAND_PX / min(first.focal_length, second.focal_length),
        _MAX_SIZE_RATIO,
        MAX_RATIO,
        _MAX_DISTANCE,
    )
    return np.column_stack([first.rows[found[:, 0]], second.rows[found[:, 1]]]).astype(np.uint32)


def axes_along(z: NDArray[np.float64]) -> NDArray[np.float64]:
    """Three orthogonal unit rows (3, 3), the last of which is ``z``."""
    x = np.cross(z, np.eye(3)[np.abs(z).argmin()])
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z])
