"""Which cameras are believed: one chi-square test of each against all others and the prediction.

The residual of a camera that is left out, in units of what the others predict for it, follows in closed form from the
fit with all of them. While any is larger than chance allows, the worst is doubted, then refused, and the rest is fitted
anew. Doubted, it errs far more than it says, but as it says: where others tell its position, its landmarks still tell
how it is turned.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.estimation.belief import Belief, Coordinates
from bodycam_ros.estimation.measurements import SegmentPoses
from bodycam_ros.geometry import Array
from bodycam_ros.kinematics.tangent import TreeTangent

GROSS = np.repeat([0.06, 0.02], 3)
"""[rad], [m] a strap that slipped by as much bends the body less than leaving out what it carries."""

ANYWHERE = 1.0
"""[rad], [m] a limb that nothing has seen is where a guess has it: no reason to refuse the camera that sees it."""

DOUBTED = 0.006
"""Information of a camera that is doubted: it errs by more than ten times of what it says."""

_LINEARISED, _NEAR = 8, 0.1  # times; [rad], [m] of a step after which it is linear enough

REFUSED = 40.0
"""Squared sigmas of 6 degrees of freedom; chance alone exceeds them once in two million."""


@dataclass(frozen=True, eq=False)
class Judged:
    """What is believed of N cameras.

    Attributes:
        trust: (N,) by which the information of each counts: 1, ``DOUBTED`` or 0.
        at: coordinates that fit what is believed.
    """

    trust: Array
    at: Coordinates


def judge(predicted: Belief, cameras: SegmentPoses, tangent: TreeTangent, guessed: NDArray[np.bool_]) -> Judged:
    """Which cameras are believed, where some coordinates (K,) of the prediction were guessed."""
    K, at, trust = tangent.count, predicted.at, np.ones(len(cameras))
    if not len(cameras):
        return Judged(trust, at)
    spread = cameras.covariances + np.diag(GROSS**2)
    covariance = predicted.covariance[:K, :K].copy()
    covariance[guessed, guessed] += ANYWHERE**2
    prior = np.linalg.inv(covariance)
    for _ in range(_LINEARISED):
        poses = at.poses(tangent)
        J, r = tangent.segment_jacobians(poses)[cameras.rows], cameras.residuals(poses)
        of_each, b_each = _told(J, r, spread)
        information = prior + of_each.sum(axis=0)
        b = b_each.sum(axis=0) - prior @ predicted.at.step_to(tangent, at)[:K]
        step = np.linalg.solve(information, b)
        if np.abs(step).max() < _NEAR:
            break
        at = at.moved(tangent, step)
    while True:
        C = np.linalg.inv(information)
        step = C @ b
        kept = trust > 0.0
        if not kept.any():
            break
        off, known = r[kept] - J[kept] @ step, J[kept] @ C @ np.swapaxes(J[kept], 1, 2)
        squared = np.einsum("ni,ni->n", off, np.linalg.solve(spread[kept] - known, off[..., None])[..., 0])
        worst = int(np.argmax(squared))
        if squared[worst] < REFUSED:
            break
        worst = int(np.flatnonzero(kept)[worst])
        trust[worst] = DOUBTED if trust[worst] == 1.0 else 0.0
        information, b = information - of_each[worst], b - b_each[worst]
        if trust[worst]:
            spread[worst] = cameras.covariances[worst] / DOUBTED + np.diag(GROSS**2)
            of_each[worst], b_each[worst] = _told(J[worst], r[worst], spread[worst])
            information, b = information + of_each[worst], b + b_each[worst]
    return Judged(trust, at.moved(tangent, step))


def _told(J: Array, r: Array, covariances: Array) -> tuple[Array, Array]:
    """Information (..., K, K) and vector (..., K) of residuals (..., 6)."""
    weighted = np.swapaxes(J, -1, -2) @ np.linalg.inv(covariances)
    return weighted @ J, (weighted @ r[..., None])[..., 0]
