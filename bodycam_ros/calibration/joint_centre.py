"""The joint between two segments from their motion (A eq. 12-14).

The joint stays put on both segments: ``parent_R_child(t) c + parent_t_child(t) = p`` for all t (A eq. 13), with the
joint c in the child and p in the parent. Differences over time leave ``[dR(t) | dt(t)] (c, 1) = 0`` (A eq. 14), whose
singular values are the rms rotations across three directions: they show whether the joint was moved enough to be
found, and whether as a hinge.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from bodycam_ros.body.segment_name import SegmentName
from bodycam_ros.calibration.rig import Rig
from bodycam_ros.errors import RangeOfMotionError
from bodycam_ros.geometry import Array, nearest_rotation

_NAME_HINGE = (
    "; if it cannot, as a knee or an elbow, name its segment shin_left, forearm_right or alike in the rig: these are "
    "straight in the N-pose, which determines that place"
)
_BALL, _HINGE = 3, 2  # directions that they turn across
_FREE = 0.05  # singular value [rad rms] below which a joint does not turn across a direction: registrations give
# 0.002; people's knees 0.02; an exercised ankle 0.1
_RESIDUAL_FLOOR_M = 0.0005  # keeps the robust weights from choosing among rounding errors
_OUTLIER_SIGMAS = 3.0  # a residual this large counts a quarter (Geman-McClure)
_ITERATIONS, _CONVERGED_M = 50, 1e-12
_TO_SIGMA = 1.4826  # the median of absolute errors of a Gaussian, times this, is its sigma


@dataclass(frozen=True, eq=False)
class JointCentre:
    """A joint on its two segments.

    Attributes:
        in_parent, in_child: (3,) its centre in the segments' frames [m]. Along directions that the joint never turned
            across, any point is as good; this one is nearest to the child's origin.
        singular_values: (3,) of A eq. 14, largest first, per root of the rows: the root mean square by which a
            direction of the child turned in the parent, from 0 for the axis of a hinge to 1.
        residuals_m: (N) distances between the joint on the parent and on the child [m], one per equation.
        axis_in_child, axis_in_parent: (3,) direction that the joint turned across least, the axis of a hinge; on the
            parent its mean over time.
    """

    in_parent: Array
    in_child: Array
    singular_values: Array
    residuals_m: Array
    axis_in_child: Array
    axis_in_parent: Array

    @property
    def freedoms(self) -> int:
        """Number of directions that the joint turned across: 3 for a ball, 2 for a hinge, fewer if it was still."""
        return int((self.singular_values > _FREE).sum())

    @property
    def is_hinge(self) -> bool:
        """Whether the joint turned about one axis only."""
        return self.freedoms == _HINGE


def find_joint_centre(parent_T_child: Array) -> JointCentre:
    """Find the joint between two segments in spite of a minority of wrong poses.

    Args:
        parent_T_child: (N, 4, 4) poses of the child in the parent over time.
    """
    weights = np.ones(len(parent_T_child))
    in_child = np.full(3, np.inf)
    for _ in range(_ITERATIONS):
        before = in_child
        centre = weighted_joint_centre(parent_T_child, weights)
        in_child = centre.in_child
        sigma = max(_TO_SIGMA * float(np.median(centre.residuals_m)), _RESIDUAL_FLOOR_M)
        weights = 1.0 / (1.0 + (centre.residuals_m / (_OUTLIER_SIGMAS * sigma)) ** 2) ** 2  # Geman-McClure
        if np.linalg.norm(in_child - before) < _CONVERGED_M:
            break
    return centre


def weighted_joint_centre(parent_T_child: Array, weights: Array) -> JointCentre:
    """Solve A eq. 14 by SVD, with the mean over time as the row that all others are compared to.

    Args:
        parent_T_child: (N, 4, 4) poses of the child in the parent over time.
        weights: (N) of the poses.
    """
    share = weights / weights.sum()
    R, t = parent_T_child[:, :3, :3], parent_T_child[:, :3, 3]
    R_mean, t_mean = np.einsum("n,nij->ij", share, R), share @ t
    root = np.sqrt(share)
    dR = (root[:, None, None] * (R - R_mean)).reshape(-1, 3)
    dt = (root[:, None] * (t - t_mean)).reshape(-1)
    U, singular_values, directions = np.linalg.svd(dR, full_matrices=False)
    # The null vector (c, 1) of [dR | dt]; null vectors (axis, 0) of a hinge are left out, which leaves the shortest c.
    turning = singular_values > min(_FREE, 0.5 * singular_values[0])
    in_child = -directions[turning].T @ ((U.T @ dt)[turning] / singular_values[turning])
    in_parent = R_mean @ in_child + t_mean
    residuals_m = np.linalg.norm(R @ in_child + t - in_parent, axis=1)
    axis = directions[-1]
    return JointCentre(in_parent, in_child, singular_values, residuals_m, axis, nearest_rotation(R_mean) @ axis)


def check_exercised(rig: Rig, centres: Mapping[str, JointCentre]) -> list[str]:
    """Child segments of the joints that turned as hinges.

    Args:
        rig: names.
        centres: child segment -> its joint.

    Raises:
        RangeOfMotionError: joints that were held still, or turned about one axis only where nothing else determines
            where on it they sit; each is named, with what to repeat.
    """
    hinges = []
    complaints = []
    for child, centre in centres.items():
        named, freedoms = SegmentName(child), centre.freedoms
        values = ", ".join(f"{value:.3f}" for value in centre.singular_values)
        values = f"(singular values {values}; each must exceed {_FREE:g})"
        if freedoms < _HINGE:
            complaints.append(f"joint {named.joint} was held still {values}: {named.exercise}")
        elif freedoms < _BALL and not named.straight_in_rest:
            complaints.append(
                f"joint {named.joint} turned about one axis only {values}, so its place along that axis is unknown: "
                f"{named.exercise}{'' if named.is_known else _NAME_HINGE}"
            )
        elif freedoms < _BALL:
            hinges.append(child)
    if complaints:
        raise RangeOfMotionError(
            "the range of motion does not determine every joint. Repeat it with these motions:\n  "
            + "\n  ".join(complaints)
        )
    return hinges
