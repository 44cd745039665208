"""The chi-square gate of each camera against all others and the prediction.

The residual of a left-out camera, in units of its predicted covariance, follows in closed form from the fit with all of
them. While the largest exceeds the gate, that camera is rejected, and the rest is fitted anew. Of two cameras on a
segment the one that fits the body is kept. ``quality/judge.py`` judges a bag, in which it is not known which were.
"""

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.estimation.estimate import LINEAR, STEPS, UNKNOWN, Coordinates, Estimate
from bodycam_ros.estimation.measurements import SegmentPoses

_GATE = 40.0  # squared sigmas of 6 degrees of freedom; chance exceeds them once in two million
_GROSS = np.repeat([0.06, 0.02], 3)  # [rad], [m] a smaller strap slip bends the body less than rejecting its camera


def gate_cameras(
    predicted: Estimate, cameras: SegmentPoses, unobserved: NDArray[np.bool_]
) -> tuple[NDArray[np.bool_], Coordinates]:
    """Which (N,) of N cameras are accepted, and the coordinates that fit these.

    Args:
        predicted: without the cameras.
        cameras: their poses.
        unobserved: (K,) predicted coordinates that had no measurement: no reason to reject a camera.
    """
    K, at, accepted = len(unobserved), predicted.at, np.ones(len(cameras), bool)
    prior = predicted.information
    if unobserved.any():
        covariance = predicted.covariance[:K, :K] + np.diag(UNKNOWN**2 * unobserved)
        prior = np.asarray(np.linalg.inv(covariance), np.float64)
    while accepted.any():
        kept = np.flatnonzero(accepted)
        spread = cameras.covariances[kept] + np.diag(_GROSS**2)
        at, information = predicted.at, np.linalg.inv(spread)
        for _ in range(STEPS):
            J, r = at.jacobians[cameras.rows[kept]], cameras.residuals(at.poses)[kept]
            weighted = np.swapaxes(J, 1, 2) @ information
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
        accepted[kept[int(np.argmax(squared))]] = False
    else:
        at = predicted.at
    return accepted, at
