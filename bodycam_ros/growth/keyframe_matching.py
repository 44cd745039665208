"""Features of two registered keyframes that show the same point: alike, and on each other's epipolar line."""

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.growth.growth_settings import GrowthSettings
from bodycam_ros.growth.worn_keyframe import WornKeyframe
from bodycam_ros.kernels import as_bytes, as_rows
from bodycam_ros.mapping.epipolar_kernels import match_along_epipolars
from bodycam_ros.mapping.epipolar_matching import axes_along


def match_keyframes(
    first: WornKeyframe,
    second: WornKeyframe,
    first_rows: NDArray[np.int64],
    second_rows: NDArray[np.int64],
    settings: GrowthSettings,
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Pairs (M,), (M,) of features, none in two pairs.

    Args:
        first, second: the keyframes, from different places.
        first_rows, second_rows: (A,), (B,) features that are asked.
        settings: tolerances.
    """
    between = second.world_T_camera[:3, 3] - first.world_T_camera[:3, 3]
    axes_world = axes_along(between / np.linalg.norm(between))
    found = match_along_epipolars(
        *_looks(first, first_rows, axes_world),
        *_looks(second, second_rows, axes_world),
        settings.epipolar_px / min(first.focal_length, second.focal_length),
        settings.max_size_ratio,
        settings.ratio,
        settings.max_distance,
    )
    return first_rows[found[:, 0]], second_rows[found[:, 1]]


def _looks(
    keyframe: WornKeyframe, rows: NDArray[np.int64], axes_world: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.uint8]]:
    """Rays (N, 3) in some axes, sizes (N,) [rad] and descriptors (N, 128) of features."""
    rays = keyframe.bearings[rows] @ keyframe.world_T_camera[:3, :3].T @ axes_world.T
    return as_rows(rays), keyframe.sizes[rows], as_bytes(keyframe.descriptors[rows])
