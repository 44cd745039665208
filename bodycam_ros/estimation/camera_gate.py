"""The chi-square gate of each camera against all others and the prediction.

The residual of a left-out camera, in units of its predicted covariance, follows in closed form from the fit with all of
them. While the largest exceeds the gate, that camera is first down-weighted, then rejected, and the rest is fitted
anew. Down-weighted, a camera whose position is wrong still measures its rotation. The verdict on a result
(``quality/judge.py``) relies on it: of two cameras on a segment the one that fits the body was kept.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.estimation.estimate import Coordinates, Estimate
from bodycam_ros.estimation.measurements import SegmentPoses
from bodycam_ros.geometry import Array

_GATE = 40.0  # squared sigmas of 6 degrees of freedom; chance exceeds them once in two million
_GROSS = np.repeat([0.06, 0.02], 3)  # [rad], [m] a smaller strap slip bends the body less than rejecting its camera
_UNOBSERVED = 1.0  # [rad], [m] sigma of a predicted limb without measurements: no reason to reject its camera
_DOWN_WEIGHT = 0.006  # of a camera that errs by more than ten times its sigmas
_ITERATIONS, _LINEAR = 8, 0.1  # at most; [rad], [m] of a step after which the fit is linear enough


@dataclass(frozen=True, eq=False)
class GatedCameras:
    """Outcome of the gate for N cameras.

    Attributes:
        weights: (N,) of the information of each: 1, the down-weight, or 0 if it is rejected.
        at: coordinates that fit the accepted ones.
    """

    weights: Array
    at: Coordinates


def gate_cameras(predicted: Estimate, cameras: SegmentPoses, unobserved: NDArray[np.bool_]) -> GatedCameras:
    """Weigh cameras, where some coordinates (K,) of the prediction had no measurement."""
    K, at, weights = len(unobserved), predicted.at, np.ones(len(cameras))
    prior = predicted.information
    if unobserved.any():
        covariance = predicted.covariance[:K, :K] + np.diag(_UNOBSERVED**2 * unobserved)
        prior = np.asarray(np.linalg.inv(covariance), np.float64)
    while (weights > 0.0).any():
        kept = np.flatnonzero(weights)
        spread = cameras.covariances[kept] / weights[kept, None, None] + np.diag(_GROSS**2)
        at = predicted.at
        for _ in range(_ITERATIONS):
            J, r = at.jacobians[cameras.rows[kept]], cameras.residuals(at.poses)[kept]
            weighted = np.swapaxes(J, 1, 2) @ np.linalg.inv(spread)
            C = np.linalg.inv(prior + (weighted @ J).sum(axis=0))
            b = (weighted @ r[..., None])[..., 0].sum(axis=0)
            step = C @ (b - prior @ predicted.at.step_to(at)[:K])
            at = at.moved(step)
            if np.abs(step).max() < _LINEAR:
                break
        off, known = r - J @ step, J @ C @ np.swapaxes(J, 1, 2)
        squared = np.einsum("ni,ni->n", off, np.linalg.solve(spread - known, off[..., None])[..., 0])
        if squared.max() < _GATE:
            break
        worst = kept[int(np.argmax(squared))]
        weights[worst] = _DOWN_WEIGHT if weights[worst] == 1.0 else 0.0
    else:
        at = predicted.at
    return GatedCameras(weights, at)
