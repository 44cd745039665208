"""Published covariances of a state, by the marginal covariance of its coordinates."""

from dataclasses import replace

import numpy as np

from bodycam_ros.body_state import BodyUncertainty
from bodycam_ros.estimation.coordinates import Coordinates
from bodycam_ros.geometry import Array

_BODY = np.diag(np.repeat([0.0002, 0.0006], 3) ** 2)  # [rad], [m] of the calibrated body, the same in all states

_UNCONVERGED = np.diag(np.repeat([0.3, 0.1], 3) ** 2)  # [rad], [m] of a state whose fit did not converge


def body_uncertainty(at: Coordinates, covariance: Array) -> BodyUncertainty:
    """Covariances of root, joints and segments.

    Args:
        at: coordinates of the state.
        covariance: (2K, 2K) of velocities, then coordinates.
    """
    tangent, J = at.tangent, at.jacobians
    K = tangent.count
    P = covariance[K:, K:]
    segments = (J.reshape(-1, K) @ P).reshape(J.shape) @ np.swapaxes(J, -1, -2)
    joints = tangent.child_turns @ P @ np.swapaxes(tangent.child_turns, -1, -2)
    segments += _BODY
    return BodyUncertainty(segments[tangent.root], covariance[:6, :6].copy(), joints, segments)


def widened(uncertainty: BodyUncertainty) -> BodyUncertainty:
    """The covariances of a state whose fit did not converge: it may be anywhere near."""
    return replace(
        uncertainty,
        root=uncertainty.root + _UNCONVERGED,
        joints=uncertainty.joints + 2.0 * _UNCONVERGED[:3, :3],
        segments=uncertainty.segments + _UNCONVERGED,
    )
