"""Which keypoints become tracks: the strong ones, none upon another."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree


def thin_out(pixels: NDArray[np.float32], strengths: NDArray[np.float32], min_distance_px: float) -> NDArray[np.intp]:
    """Rows of points (N, 2) that keep a distance from each other; of two too near the stronger stays.

    Args:
        pixels: (N, 2).
        strengths: (N,).
        min_distance_px: distance kept [px].
    """
    if len(pixels) == 0:
        return np.zeros(0, np.intp)
    pairs = cKDTree(pixels).query_pairs(min_distance_px, output_type="ndarray")
    rank = np.empty(len(pixels), np.intp)
    rank[np.argsort(-strengths, kind="stable")] = np.arange(len(pixels))
    stronger_first = np.where((rank[pairs[:, 0]] < rank[pairs[:, 1]])[:, None], pairs, pairs[:, ::-1])
    kept = np.ones(len(pixels), bool)
    # A point falls only to one that stays itself, so the strongest must be asked first.
    for stronger, weaker in stronger_first[np.argsort(rank[stronger_first[:, 0]], kind="stable")].tolist():
        if kept[stronger]:
            kept[weaker] = False
    return np.flatnonzero(kept)


def far_from(pixels: NDArray[np.float32], others: NDArray[np.float32], min_distance_px: float) -> NDArray[np.bool_]:
    """Which points (N, 2) have none of the others (M, 2) within a distance [px]."""
    if len(pixels) == 0 or len(others) == 0:
        return np.ones(len(pixels), bool)
    nearest, _ = cKDTree(others).query(pixels, distance_upper_bound=min_distance_px)
    return np.asarray(~np.isfinite(nearest))
