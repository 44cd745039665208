"""Features of two registered keyframes that show the same point: alike, and on each other's epipolar line."""

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.growth.growth_settings import GrowthSettings
from bodycam_ros.growth.worn_keyframe import WornKeyframe

_PARALLEL = 1e-9


def match_keyframes(
    first: WornKeyframe,
    second: WornKeyframe,
    first_rows: NDArray[np.int64],
    second_rows: NDArray[np.int64],
    settings: GrowthSettings,
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Pairs (M,), (M,) of features, none in two pairs.

    Args:
        first, second: the keyframes.
        first_rows, second_rows: (A,), (B,) features that are asked.
        settings: tolerances.
    """
    nothing = np.zeros(0, np.int64)
    if not len(first_rows) or not len(second_rows):
        return nothing, nothing
    products = first.descriptors[first_rows].astype(np.float32) @ second.descriptors[second_rows].astype(np.float32).T
    lengths = [
        np.einsum("ij,ij->i", d, d)
        for d in (k.descriptors[r].astype(np.float32) for k, r in ((first, first_rows), (second, second_rows)))
    ]
    squared = lengths[0][:, None] + lengths[1][None] - 2.0 * products
    squared[~_may_meet(first, second, first_rows, second_rows, settings)] = np.inf
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
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), _PARALLEL)
    in_plane = np.abs(normals @ others.T) < settings.epipolar_px / min(first.focal_length, second.focal_length)
    # In that plane the second ray is turned away from the baseline by more than the first, on the same side.
    before = rays @ between
    sides = np.cross(normals, between)
    same_side = (sides @ others.T) * np.einsum("ij,ij->i", sides, rays)[:, None] > 0.0
    meets: NDArray[np.bool_] = in_plane & same_side & ((others @ between)[None] < before[:, None])
    return meets
