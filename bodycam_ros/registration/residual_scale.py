"""How much worse an image's measurements are than was assumed, by its own residuals: blurred and dark images say so.

Weights follow: the information of a pose counts pixels of one size for all images, and is divided by the square of
this.
"""

import math

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.kernels import kernel

_LEAST_LANDMARKS = 15
"""Fewer residuals tell their own size to a fifth at best, and six of them went into the pose."""

_MOST = 4.0
"""Beyond it the residuals are of wrong landmarks, which the kernel and the cameras' trust deal with."""

_MEDIAN_OF_RAYLEIGH = 1.1774
"""The median length of a vector of two normal errors, in standard deviations of one."""

_POSE = 6


@kernel("(f8[::1], b1[::1], f8)")
def residual_scale(errors_px: NDArray[np.float64], inliers: NDArray[np.bool_], pixel_sigma: float) -> float:
    """Factor from 1 up by which an image's errors exceed those that were assumed, from the median of its inliers.

    Args:
        errors_px: (N,) lengths of reprojection errors [px].
        inliers: (N,) which of them are measurements.
        pixel_sigma: what was assumed of one axis [px].
    """
    count = inliers.sum()
    if count < _LEAST_LANDMARKS:
        return 1.0
    sigma = np.median(errors_px[inliers]) / _MEDIAN_OF_RAYLEIGH
    # The pose has taken six of the residuals' degrees of freedom for itself.
    sigma *= math.sqrt(2.0 * count / (2.0 * count - _POSE))
    return float(min(max(sigma / pixel_sigma, 1.0), _MOST))
