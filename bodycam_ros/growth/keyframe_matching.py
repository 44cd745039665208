"""Features of two registered keyframes that show the same point: alike, and on each other's epipolar line."""

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.growth.growth_settings import GrowthSettings
from bodycam_ros.growth.matching_kernels import match_along_epipolar_lines
from bodycam_ros.growth.worn_keyframe import WornKeyframe
from bodycam_ros.kernels.kernel import as_rows


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
    nearest, best, rival = match_along_epipolar_lines(
        np.ascontiguousarray(first.descriptors[first_rows]),
        np.ascontiguousarray(second.descriptors[second_rows]),
        as_rows(first.bearings[first_rows] @ first.world_T_camera[:3, :3].T),
        as_rows(second.bearings[second_rows] @ second.world_T_camera[:3, :3].T),
        as_rows(between / np.linalg.norm(between)),
        settings.epipolar_px / min(first.focal_length, second.focal_length),
    )
    good = (nearest >= 0) & (best < settings.max_distance**2) & (best < settings.ratio**2 * rival)
    return first_rows[good], second_rows[nearest[good]]
