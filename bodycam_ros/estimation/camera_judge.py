"""Which cameras are believed: one chi-square test of each against all others and the prediction.

The residual of a camera that is left out, in units of what the others predict for it, follows in closed form from the
fit with all of them. While any is larger than chance allows, the worst is refused and the rest is fitted anew.
"""

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.estimation.belief import Belief, Coordinates
from bodycam_ros.estimation.measurements import SegmentPoses
from bodycam_ros.kinematics.tangent import TreeTangent

GROSS = np.repeat([0.06, 0.02], 3)
"""[rad], [m] a strap that slipped by as much bends the body less than leaving out what it carries."""

ANYWHERE = 1.0
"""[rad], [m] a limb that nothing has seen is where a guess has it: no reason to refuse the camera that sees it."""

_LINEARISED, _NEAR = 8, 0.1  # times; [rad], [m] of a step after which it is linear enough

REFUSED = 40.0
"""Squared sigmas of 6 degrees of freedom; chance alone exceeds them once in two million."""


def judge(
    predicted: Belief, cameras: SegmentPoses, tangent: TreeTangent, guessed: NDArray[np.bool_]
) -> tuple[NDArray[np.bool_], Coordinates]:
    """Which (N,) of the cameras are believed, and the coordinates that fit those."""
    K = tangent.count
    kept, at = np.ones(len(cameras), bool), predicted.at
    if not len(cameras):
        return kept, at
    spread = cameras.covariances + np.diag(GROSS**2)
    certainty = np.linalg.inv(spread)
    covariance = predicted.covariance[:K, :K].copy()
    covariance[guessed, guessed] += ANYWHERE**2
    prior = np.linalg.inv(covariance)
    for _ in range(_LINEARISED):
        poses = at.poses(tangent)
        J, r = tangent.segment_jacobians(poses)[cameras.rows], cameras.residuals(poses)
        weighted = np.swapaxes(J, 1, 2) @ certainty
        of_each, b_each = weighted @ J, (weighted @ r[..., None])[..., 0]
        information = prior + of_each.sum(axis=0)
        b = b_each.sum(axis=0) - prior @ predicted.at.step_to(tangent, at)[:K]
        step = np.linalg.solve(information, b)
        if np.abs(step).max() < _NEAR:
            break
        at = at.moved(tangent, step)
    while True:
        C = np.linalg.inv(information)
        step = C @ b
        if not kept.any():
            break
        off, told = r[kept] - J[kept] @ step, J[kept] @ C @ np.swapaxes(J[kept], 1, 2)
        squared = np.einsum("ni,ni->n", off, np.linalg.solve(spread[kept] - told, off[..., None])[..., 0])
        worst = int(np.argmax(squared))
        if squared[worst] < REFUSED:
            break
        worst = int(np.flatnonzero(kept)[worst])
        kept[worst] = False
        information, b = information - of_each[worst], b - b_each[worst]
    return kept, at.moved(tangent, step)
