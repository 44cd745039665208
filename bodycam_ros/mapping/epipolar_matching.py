"""Pairs of photographs whose poses are nearly known, matched in full: a tenth of the work of matching them blindly.

Where the poses tell on which line of the other photograph a feature must show, the few that are near it are asked, and
repeated texture is no rival unless it lies there too.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.local_scale import scales_at
from bodycam_ros.kernels import as_rows
from bodycam_ros.mapping.epipolar_kernels import match_along_epipolars
from bodycam_ros.mapping.features import ImageFeatures
from bodycam_ros.mapping.progress import Advance, in_parallel
from bodycam_ros.settings import setting


@dataclass(frozen=True)
class EpipolarSettings:
    """How features are matched once the poses of the photographs are nearly known."""

    band_px: float = setting(
        4.0, unit="px", limits=(0.5, 50.0), reason="from the epipolar line; poses of few features err by one or two"
    )
    max_ratio: float = setting(
        0.8, limits=(0.3, 1.0), reason="best to second best distance of descriptors along the line (Lowe 2004)"
    )
    max_distance: float = setting(260.0, limits=(50.0, 724.0), reason="between RootSIFT vectors of length 512")
    max_size_ratio: float = setting(
        2.0, limits=(1.1, 10.0), reason="size of a feature against the one that the distance of the point predicts"
    )


@dataclass(frozen=True)
class _Looks:
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
    settings: EpipolarSettings,
    workers: int,
    advance: Advance,
) -> list[NDArray[np.uint32]]:
    """Match pairs of photographs along their epipolar lines.

    Args:
        features: of the K photographs.
        cameras: that took each.
        world_T_camera: (K, 4, 4) their poses.
        pairs: rows of the photographs, which were taken from different places.
        settings: tolerances.
        workers: threads.
        advance: called for each pair.

    Returns:
        for each pair (M, 2) rows of features that match.
    """
    looks = [_looks(*photograph) for photograph in zip(features, cameras, world_T_camera, strict=True)]

    def match(pair: tuple[int, int]) -> NDArray[np.uint32]:
        return _match(looks[pair[0]], looks[pair[1]], settings)

    matches = []
    for found in in_parallel(match, pairs, workers):
        matches.append(found)
        advance()
    return matches


def _looks(image: ImageFeatures, camera: CameraModel, pose: NDArray[np.float64]) -> _Looks:
    rays, valid = camera.unproject(image.pixels)
    rows = np.flatnonzero(valid)
    return _Looks(
        rays_world=rays[rows] @ pose[:3, :3].T,
        sizes=image.sigmas[rows] / scales_at(camera, rays[rows, 2]),
        descriptors=np.require(image.descriptors[rows], np.uint8, ("C", "W")),
        rows=rows,
        centre=pose[:3, 3],
        focal_length=camera.fx,
    )


def _match(first: _Looks, second: _Looks, settings: EpipolarSettings) -> NDArray[np.uint32]:
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
        settings.band_px / min(first.focal_length, second.focal_length),
        settings.max_size_ratio,
        settings.max_ratio,
        settings.max_distance,
    )
    return np.column_stack([first.rows[found[:, 0]], second.rows[found[:, 1]]]).astype(np.uint32)


def axes_along(z: NDArray[np.float64]) -> NDArray[np.float64]:
    """Three orthogonal unit rows (3, 3), the last of which is ``z``."""
    x = np.cross(z, np.eye(3)[np.abs(z).argmin()])
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z])
