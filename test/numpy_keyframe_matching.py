"""The matching of two keyframes in NumPy: what the compiled one is held to."""

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.growth.growth_settings import GrowthSettings
from bodycam_ros.growth.worn_keyframe import WornKeyframe


def match_keyframes_in_numpy(
    first: WornKeyframe,
    second: WornKeyframe,
    first_rows: NDArray[np.int64],
    second_rows: NDArray[np.int64],
    settings: GrowthSettings,
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    if not len(first_rows) or not len(second_rows):
        return np.zeros(0, np.int64), np.zeros(0, np.int64)
    ours, theirs = (k.descriptors[r].astype(np.int64) for k, r in ((first, first_rows), (second, second_rows)))
    squared = (ours**2).sum(axis=1)[:, None] + (theirs**2).sum(axis=1) - 2 * ours @ theirs.T
    squared = np.where(_may_meet(first, second, first_rows, second_rows, settings), squared.astype(np.float64), np.inf)
    rows = np.arange(len(first_rows))
    nearest = squared.argmin(axis=1)
    best = squared[rows, nearest]
    mutual = squared.argmin(axis=0)[nearest] == rows
    squared[rows, nearest] = np.inf
    good = mutual & (best < settings.max_distance**2) & (best < settings.ratio**2 * squared.min(axis=1))
    return first_rows[good], second_rows[nearest[good]]


def _may_meet(
    first: WornKeyframe,
    second: WornKeyframe,
    first_rows: NDArray[np.int64],
    second_rows: NDArray[np.int64],
    settings: GrowthSettings,
) -> NDArray[np.bool_]:
    """(A, B) whether the rays nearly lie in one plane with both centres, and meet before the cameras."""
    rays = first.bearings[first_rows] @ first.world_T_camera[:3, :3].T
    others = second.bearings[second_rows] @ second.world_T_camera[:3, :3].T
    between = second.world_T_camera[:3, 3] - first.world_T_camera[:3, 3]
    between /= np.linalg.norm(between)
    normals = np.cross(rays, between)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    in_plane = np.abs(normals @ others.T) < settings.epipolar_px / min(first.focal_length, second.focal_length)
    # In that plane the second ray is turned away from the baseline by more than the first, on the same side.
    across = np.cross(between, normals)
    meets: NDArray[np.bool_] = (
        in_plane & (across @ others.T > 0.0) & ((others @ between)[None] < (rays @ between)[:, None])
    )
    return meets
