"""How well the body is known at an instant: covariances of root, joints and segments, from the one of the belief."""

import numpy as np

from bodycam_ros.body_state import BodyUncertainty
from bodycam_ros.estimation.belief import Belief
from bodycam_ros.kinematics.tangent import TreeTangent

_ALIKE_S = 0.3
"""Errors of registrations fade so slowly (0.9 from image to image at 30 Hz), so that differences err far less."""

_BODY = np.diag(np.repeat([0.0002, 0.0006], 3) ** 2)
"""[rad], [m] error of the calibrated body itself, which no registration knows of, the same at all instants."""


def body_uncertainty(belief: Belief, tangent: TreeTangent, dt_s: float, root_seen: bool) -> BodyUncertainty:
    """Covariances of a belief.

    Args:
        belief: of the instant.
        tangent: its coordinates.
        dt_s: since the instant before [s]; 0 where there is none.
        root_seen: whether a camera on the root is believed.
    """
    K, P = tangent.count, belief.covariance
    J = tangent.segment_jacobians(belief.at.poses(tangent))
    segments = (J.reshape(-1, K) @ P[:K, :K]).reshape(J.shape) @ np.swapaxes(J, -1, -2) + _BODY
    joints = np.zeros((len(tangent.twists), 3, 3))
    for row, (joint, columns) in enumerate(zip(tangent.tree.tree_joints, tangent.columns, strict=True)):
        turns = joint.child_T_joint[:3, :3] @ tangent.twists[row][:3]
        joints[row] = turns @ P[columns, columns] @ turns.T
    root = segments[tangent.tree.segment_index[tangent.tree.root]]
    twist = P[K : K + 6, K : K + 6].copy()
    if root_seen and dt_s > 0.0:
        # The difference of two poses whose errors are nearly the same.
        twist = 2.0 * (1.0 - np.exp(-dt_s / _ALIKE_S)) / dt_s**2 * root
    return BodyUncertainty(root, twist, joints, segments)
