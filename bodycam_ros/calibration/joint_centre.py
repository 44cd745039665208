"""The centre of a joint from the motion of the two segments that it joins (A appendix, eq. 12-14; O'Brien et al. 2000).

The joint stays put on both segments: ``parent_R_child(t) c + parent_t_child(t) = p`` for all t (A eq. 13), with the
joint c in the child and p in the parent. Differences over time leave ``[dR(t) | dt(t)] (c, 1) = 0`` (A eq. 14), whose
singular values say which directions the joint ever turned across: whether it was moved enough to be found, and whether
as a hinge.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.calibration.anatomy import SegmentName
from bodycam_ros.calibration.rig import Rig
from bodycam_ros.errors import RangeOfMotionError
from bodycam_ros.settings import setting

Array = NDArray[np.float64]

_BALL, _HINGE = 3, 2  # directions that they turn across

_ITERATIONS = 50
_CONVERGED_M = 1e-12
_TO_SIGMA = 1.4826  # the median of absolute errors of a Gaussian, times this, is its sigma


@dataclass(frozen=True)
class JointCentreSettings:
    """How a joint is read off the motion."""

    free_rotation: float = setting(
        0.05,
        limits=(0.001, 0.5),
        reason="a singular value below this, about radians rms, is no motion but noise: across that direction the "
        "joint does not turn. Registrations give 0.002; people's knees 0.02; an exercised ankle 0.1",
    )
    min_instants: int = setting(
        30, limits=(4, 10000), reason="instants in which both segments of a joint must be known; one second of video"
    )
    residual_floor: float = setting(
        0.0005,
        unit="m",
        limits=(0.0, 0.1),
        reason="residuals below this are all good; keeps the robust weights from choosing among rounding errors",
    )
    outlier_sigmas: float = setting(
        3.0,
        limits=(1.0, 100.0),
        reason="a residual this many sigmas large counts a quarter, and larger ones soon nothing (Geman-McClure)",
    )


@dataclass(frozen=True, eq=False)
class JointCentre:
    """A joint on its two segments.

    Attributes:
        in_parent, in_child: (3,) its centre in the segments' frames [m]. Along directions that the joint never turned
            across, any point is as good; this one is nearest to the child's origin.
        singular_values: (3,) of A eq. 14, largest first, per root of the instants: the root mean square by which a
            direction of the child turned in the parent, from 0 for the axis of a hinge to 1.
        child_directions: (3, 3) rows: the directions in the child that belong to them.
        parent_directions: (3, 3) rows: the same in the parent; that of a hinge's axis is the axis there.
        residuals_m: (N) distances between the joint on the parent and on the child [m], one per equation.
        weights: (N) of the equations, 0 to 1.
    """

    in_parent: Array
    in_child: Array
    singular_values: Array
    child_directions: Array
    parent_directions: Array
    residuals_m: Array
    weights: Array

    def freedoms(self, settings: JointCentreSettings) -> int:
        """How many directions the joint turned across: 3 for a ball, 2 for a hinge, fewer if it was held still."""
        return int((self.singular_values > settings.free_rotation).sum())


def find_joint_centre(parent_T_child: Array, weights: Array, settings: JointCentreSettings) -> JointCentre:
    """Find the joint between two segments, whatever a minority of wrong poses says.

    Args:
        parent_T_child: (N, 4, 4) poses of the child in the parent over time; of every pair of cameras on the two.
        weights: (N) how much each counts before it is looked at.
        settings: thresholds.
    """
    robust = np.ones(len(parent_T_child))
    in_child = np.full(3, np.inf)
    for _ in range(_ITERATIONS):
        before = in_child
        centre = _weighted_centre(parent_T_child, weights * robust, settings)
        in_child = centre.in_child
        sigma = max(_TO_SIGMA * _weighted_median(centre.residuals_m, weights), settings.residual_floor)
        # Geman-McClure.
        robust = 1.0 / (1.0 + (centre.residuals_m / (settings.outlier_sigmas * sigma)) ** 2) ** 2
        if np.linalg.norm(in_child - before) < _CONVERGED_M:
            break
    return JointCentre(
        centre.in_parent,
        centre.in_child,
        centre.singular_values,
        centre.child_directions,
        centre.parent_directions,
        centre.residuals_m,
        robust * (weights > 0),
    )


def check_exercised(rig: Rig, centres: Mapping[str, JointCentre], settings: JointCentreSettings) -> dict[str, Array]:
    """Hinges among the joints: child segment -> (3,) axis in the frame of the child's virtual camera.

    Args:
        rig: names.
        centres: child segment -> its joint.
        settings: thresholds.

    Raises:
        RangeOfMotionError: joints that were held still, or turned about one axis only where nothing else tells where
            on it they sit; each is named, with what to repeat.
    """
    hinges = {}
    complaints = []
    for child, centre in centres.items():
        named = SegmentName(child)
        freedoms = centre.freedoms(settings)
        values = ", ".join(f"{value:.3f}" for value in centre.singular_values)
        if freedoms < _HINGE:
            complaints.append(
                f"joint {named.joint} was held still (singular values {values}; each must exceed "
                f"{settings.free_rotation:g}): {named.exercise}"
            )
        elif freedoms < _BALL and not named.straight_in_rest:
            complaints.append(
                f"joint {named.joint} was turned about one axis only (singular values {values}; each must exceed "
                f"{settings.free_rotation:g}), so its place along that axis is open: {named.exercise}"
            )
        elif freedoms < _BALL:
            hinges[child] = centre.child_directions[2]
    if complaints:
        raise RangeOfMotionError(
            "the range of motion does not tell where every joint is. Repeat it, and\n  " + "\n  ".join(complaints)
        )
    return hinges


def _weighted_centre(parent_T_child: Array, weights: Array, settings: JointCentreSettings) -> JointCentre:
    """Solve A eq. 14 by SVD, with the mean over time as the instant that all others are compared to."""
    share = weights / weights.sum()
    R, t = parent_T_child[:, :3, :3], parent_T_child[:, :3, 3]
    R_mean, t_mean = np.einsum("n,nij->ij", share, R), share @ t
    root = np.sqrt(share)
    dR = (root[:, None, None] * (R - R_mean)).reshape(-1, 3)
    dt = (root[:, None] * (t - t_mean)).reshape(-1)
    U, singular_values, directions = np.linalg.svd(dR, full_matrices=False)
    # The null vector (c, 1) of [dR | dt]; null vectors (axis, 0) of a hinge are left out, which leaves the shortest c.
    turning = singular_values > min(settings.free_rotation, 0.5 * singular_values[0])
    in_child = -directions[turning].T @ ((U.T @ dt)[turning] / singular_values[turning])
    in_parent = R_mean @ in_child + t_mean
    residuals_m = np.linalg.norm(R @ in_child + t - in_parent, axis=1)
    parent_directions = directions @ R_mean.T
    lengths = np.linalg.norm(parent_directions, axis=1, keepdims=True)
    parent_directions = parent_directions / np.maximum(lengths, np.finfo(float).tiny)
    return JointCentre(in_parent, in_child, singular_values, directions, parent_directions, residuals_m, weights)


def _weighted_median(values: Array, weights: Array) -> float:
    order = np.argsort(values)
    reached = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(reached, 0.5 * reached[-1])])
