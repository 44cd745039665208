"""Rotation of a camera between two frames, from bearings (A eq. 2).

The paper takes the rotation from a homography between images whose camera centres nearly coincide. A
homography needs a plane of projection, which a lens of 150 degrees does not have, so the same rotation is
fitted to unit bearings instead: ``bearing_current = current_R_previous @ bearing_previous``.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.geometry import hat
from bodycam_ros.settings import setting


@dataclass(frozen=True)
class RotationSettings:
    """How far a bearing may be from the rotation, and how hard to look for it."""

    inlier_angle_deg: float = setting(
        0.8,
        unit="deg",
        limits=(0.05, 5.0),
        reason="parallax of a limb at 1 m/s and 30 Hz against a wall at 3 m is 0.6 deg, so far "
        "points agree and near ones do not",
    )
    hypotheses: int = setting(
        24, limits=(8, 512), reason="pairs sampled; 24 find a clean pair among 60 % outliers with 98 %"
    )
    min_inliers: int = setting(
        12, limits=(4, 200), reason="below this many agreeing tracks the rotation is called unknown"
    )


def estimate_rotation(
    bearings_previous: NDArray[np.float64],
    bearings_current: NDArray[np.float64],
    settings: RotationSettings,
    seed: int,
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Find the rotation that most tracks agree on (A eq. 2), by RANSAC over pairs of bearings.

    Args:
        bearings_previous: (N, 3) unit bearings in the previous camera frame.
        bearings_current: (N, 3) the same tracks in the current camera frame.
        settings: thresholds.
        seed: of the sampling, so that two runs over one recording are identical.

    Returns:
        current_R_previous (3, 3) and the (N,) tracks that agree with it. With too few tracks in agreement the
        rotation is the identity and no track agrees.
    """
    nobody = np.zeros(len(bearings_previous), bool)
    if len(bearings_previous) < settings.min_inliers:
        return np.eye(3), nobody
    max_chord = 2 * np.sin(np.radians(settings.inlier_angle_deg) / 2)

    hypotheses = _rotations_of_pairs(bearings_previous, bearings_current, settings.hypotheses, seed)
    chords = np.linalg.norm(bearings_previous @ hypotheses.transpose(0, 2, 1) - bearings_current, axis=2)
    best = int(np.argmin(np.minimum(chords, max_chord).sum(axis=1)))
    current_R_previous = hypotheses[best]
    inliers = chords[best] < max_chord

    for _ in range(2):
        if inliers.sum() < settings.min_inliers:
            return np.eye(3), nobody
        current_R_previous = align_bearings(bearings_previous[inliers], bearings_current[inliers])
        inliers = np.linalg.norm(bearings_previous @ current_R_previous.T - bearings_current, axis=1) < max_chord
    if inliers.sum() < settings.min_inliers:
        return np.eye(3), nobody
    return current_R_previous, inliers


def align_bearings(source: NDArray[np.float64], target: NDArray[np.float64]) -> NDArray[np.float64]:
    """Least-squares rotation target_R_source (3, 3) between (N, 3) unit vectors (Kabsch 1976)."""
    u, _, vt = np.linalg.svd(target.T @ source)
    return np.asarray(u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt)


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
