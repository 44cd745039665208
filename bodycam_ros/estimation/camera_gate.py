"""The chi-square gate of each camera against all others and the prediction.

The residual of a left-out camera, in units of its predicted covariance, follows in closed form from the fit with all of
them. While the largest exceeds the gate, that camera is first down-weighted, then rejected, and the rest is fitted
anew. Down-weighted, a camera whose position is wrong still measures its rotation. Of two cameras on a segment the one
that fits the body is kept. The weights end here: ``quality/judge.py`` judges a bag, in which they are not.
"""

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.estimation.estimate import LINEAR, STEPS, UNKNOWN, Coordinates, Estimate
from bodycam_ros.estimation.measurements import SegmentPoses
from bodycam_ros.geometry import Array

_GATE = 40.0  # squared sigmas of 6 degrees of freedom; chance exceeds them once in two million
_GROSS = np.repeat([0.06, 0.02], 3)  # [rad], [m] a smaller strap slip bends the body less than rejecting its camera
_DOWN_WEIGHT = 0.006  # of a camera that errs by more than ten times its sigmas


def gate_cameras(
    predicted: Estimate, cameras: SegmentPoses, unobserved: NDArray[np.bool_]
) -> tuple[Array, Coordinates]:
    """Weights (N,) of the information of N cameras: 1, the down-weight, or 0 if rejected; coordinates that fit these.

    Args:
        predicted: without the cameras.
        cameras: their poses.
        unobserved: (K,) predicted coordinates that had no measurement: no reason to reject a camera.
    """
    K, at, weights = len(unobserved), predicted.at, np.ones(len(cameras))
    prior = predicted.information
    if unobserved.any():
        covariance = predicted.covariance[:K, :K] + np.diag(UNKNOWN**2 * unobserved)
        prior = np.asarray(np.linalg.inv(covariance), np.float64)
    while (weights > 0.0).any():
        kept = np.flatnonzero(weights)
        spread = cameras.covariances[kept] / weights[kept, None, None] + np.diag(_GROSS**2)
        at = predicted.at
        for _ in range(STEPS):
            J, r = at.jacobians[cameras.rows[kept]], cameras.residuals(at.poses)[kept]
            weighted = np.swapaxes(J, 1, 2) @ np.linalg.inv(spread)
            C = np.linalg.inv(prior + (weighted @ J).sum(axis=0))
            b = (weighted @ r[..., None])[..., 0].sum(axis=0)
            step = C @ (b - prior @ predicted.at.step_to(at)[:K])
            at = at.moved(step)
            if np.abs(step).max() < LINEAR:
                break
        off, known = r - J @ step, J @ C @ np.swapaxes(J, 1, 2)
        squared = np.einsum("ni,ni->n", off, np.linalg.solve(spread - known, off[..., None])[..., 0])
        if squared.max() < _GATE:
            break
        worst = kept[int(np.argmax(squared))]
        weights[worst] = _DOWN_WEIGHT if weights[worst] == 1.0 else 0.0
    else:
        at = predicted.at
    return weights, at
