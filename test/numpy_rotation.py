"""The rotation between frames in NumPy: what the compiled one is held to."""

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.geometry import hat, nearest_rotation
from bodycam_ros.tracking.rotation import HYPOTHESES, INLIER_ANGLE_DEG, MIN_INLIERS


def estimate_rotation_in_numpy(
    bearings_previous: NDArray[np.float64],
    bearings_current: NDArray[np.float64],
    seed: int,
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    nobody = np.zeros(len(bearings_previous), bool)
    if len(bearings_previous) < MIN_INLIERS:
        return np.eye(3), nobody
    max_chord = 2 * np.sin(np.radians(INLIER_ANGLE_DEG) / 2)

    hypotheses = _rotations_of_pairs(bearings_previous, bearings_current, HYPOTHESES, seed)
    chords = np.linalg.norm(bearings_previous @ hypotheses.transpose(0, 2, 1) - bearings_current, axis=2)
    best = int(np.argmin(np.minimum(chords, max_chord).sum(axis=1)))
    current_R_previous = hypotheses[best]
    inliers = chords[best] < max_chord

    for _ in range(2):
        if inliers.sum() < MIN_INLIERS:
            return np.eye(3), nobody
        current_R_previous = nearest_rotation(bearings_current[inliers].T @ bearings_previous[inliers])
        inliers = np.linalg.norm(bearings_previous @ current_R_previous.T - bearings_current, axis=1) < max_chord
    if inliers.sum() < MIN_INLIERS:
        return np.eye(3), nobody
    return current_R_previous, inliers


def _rotations_of_pairs(
    previous: NDArray[np.float64], current: NDArray[np.float64], count: int, seed: int
) -> NDArray[np.float64]:
    """Rotations (count, 3, 3) that carry sampled pairs of bearings over, by their common triads (Black 1964)."""
    first, second = np.random.default_rng(seed).integers(0, len(previous), (2, count))
    return _triads(current[first], current[second]) @ _triads(previous[first], previous[second]).transpose(0, 2, 1)


def _triads(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Right-handed frames (N, 3, 3) in columns: between two bearings (N, 3), across them, and the third."""
    middle = a + b
    across = hat(a) @ b[:, :, None]
    middle, across = middle / _norms(middle), across[:, :, 0] / _norms(across[:, :, 0])
    return np.stack([middle, across, (hat(middle) @ across[:, :, None])[:, :, 0]], axis=2)


def _norms(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Lengths (N, 1), not quite zero: a bearing that was sampled twice yields no rotation, but no NaN either."""
    lengths: NDArray[np.float64] = np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-9)
    return lengths
