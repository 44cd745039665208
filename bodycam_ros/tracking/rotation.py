"""Rotation of a camera between two frames, from bearings (A eq. 2).

The paper takes the rotation from a homography between images whose camera centres nearly coincide. A
homography needs a plane of projection, which a lens of 150 degrees does not have, so the same rotation is
fitted to unit bearings instead: ``bearing_current = current_R_previous @ bearing_previous``.
"""

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.geometry import nearest_rotation

Array = NDArray[np.float64]

INLIER_ANGLE_DEG = 0.8  # parallax of a limb at 1 m/s and 30 Hz against a wall at 3 m is 0.6 deg
HYPOTHESES = 24  # pairs sampled: they contain a clean pair among 60 % outliers with 98 %
MIN_INLIERS = 12  # below this many agreeing tracks the rotation is unknown
_REFITS = 2


def estimate_rotation(
    bearings_previous: Array,
    bearings_current: Array,
    seed: int,
    inlier_angle_deg: float = INLIER_ANGLE_DEG,
    hypotheses: int = HYPOTHESES,
) -> tuple[Array, NDArray[np.bool_]]:
    """Find the rotation that most tracks agree on (A eq. 2): RANSAC over pairs of bearings, then two fits.

    Args:
        bearings_previous: (N, 3) unit bearings in the previous camera frame.
        bearings_current: (N, 3) the same tracks in the current camera frame.
        seed: of the sampling, so that two runs over one recording are identical.
        inlier_angle_deg: largest angle between a bearing and its prediction by the rotation.
        hypotheses: pairs sampled.

    Returns:
        current_R_previous (3, 3) and the (N,) tracks that agree with it. With too few tracks in agreement the
        rotation is the identity and no track agrees.
    """
    count = len(bearings_previous)
    if count < MIN_INLIERS:
        return np.eye(3), np.zeros(count, bool)
    pairs = np.random.default_rng(seed).integers(0, count, (2, hypotheses))
    sums = np.einsum("phi,phj->hij", bearings_current[pairs], bearings_previous[pairs])
    rotations = nearest_rotation(sums)
    # The scalar product c . R p of unit vectors gives the distance; it is one product of matrices for all.
    products = np.einsum("ni,nj->ijn", bearings_current, bearings_previous).reshape(9, count)
    least_cosine = np.cos(np.radians(inlier_angle_deg))
    cosines = np.clip(rotations.reshape(hypotheses, 9) @ products, least_cosine, 1.0)
    rotation = rotations[np.sqrt(1.0 - cosines).sum(axis=1).argmin()]
    agree = rotation.ravel() @ products > least_cosine
    for _ in range(_REFITS):
        if agree.sum() >= MIN_INLIERS:
            rotation = nearest_rotation(bearings_current[agree].T @ bearings_previous[agree])
            agree = rotation.ravel() @ products > least_cosine
    if agree.sum() < MIN_INLIERS:
        return np.eye(3), np.zeros(count, bool)
    return rotation, agree
