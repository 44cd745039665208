"""Rotation of a camera between two frames, from bearings (A eq. 2).

The paper takes the rotation from a homography between images whose camera centres nearly coincide. A
homography needs a plane of projection, which a lens of 150 degrees does not have, so the same rotation is
fitted to unit bearings instead: ``bearing_current = current_R_previous @ bearing_previous``.
"""

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.kernels import as_rows
from bodycam_ros.tracking.rotation_kernels import agreed_rotation

INLIER_ANGLE_DEG = 0.8  # parallax of a limb at 1 m/s and 30 Hz against a wall at 3 m is 0.6 deg
HYPOTHESES = 24  # pairs sampled: they contain a clean pair among 60 % outliers with 98 %
MIN_INLIERS = 12  # below this many agreeing tracks the rotation is unknown


def estimate_rotation(
    bearings_previous: NDArray[np.float64],
    bearings_current: NDArray[np.float64],
    seed: int,
    inlier_angle_deg: float = INLIER_ANGLE_DEG,
    hypotheses: int = HYPOTHESES,
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Find the rotation that most tracks agree on (A eq. 2), by RANSAC over pairs of bearings.

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
    samples = np.random.default_rng(seed).integers(0, count, (2, hypotheses))
    max_chord = float(2 * np.sin(np.radians(inlier_angle_deg) / 2))
    return agreed_rotation(as_rows(bearings_previous), as_rows(bearings_current), samples, max_chord, MIN_INLIERS)
