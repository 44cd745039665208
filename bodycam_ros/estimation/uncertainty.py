"""Published covariances of a state, by the marginal covariance of its coordinates."""

from dataclasses import replace

import numpy as np

from bodycam_ros.body_state import BodyUncertainty
from bodycam_ros.estimation.coordinates import Coordinates
from bodycam_ros.geometry import Array

_CORRELATED_S = 0.3  # errors of registrations last so long (0.9 from image to image at 30 Hz): differences err less
_BODY = np.diag(np.repeat([0.0002, 0.0006], 3) ** 2)  # [rad], [m] of the calibrated body, the same in all states

_UNCONVERGED = np.diag(np.repeat([0.3, 0.1], 3) ** 2)  # [rad], [m] of a state whose fit did not converge


def body_uncertainty(at: Coordinates, covariance: Array, dt_s: float, root_observed: bool) -> BodyUncertainty:
    """Covariances of root, joints and segments.

    Args:
        at: coordinates of the state.
        covariance: (2K, 2K) of velocities, then coordinates.
        dt_s: since the state before [s]; 0 where there is none.
        root_observed: whether a camera observes the root.
    """
    tangent, J = at.tangent, at.jacobians
    K = tangent.count
    P = covariance[K:, K:]
    segments = (J.reshape(-1, K) @ P).reshape(J.shape) @ np.swapaxes(J, -1, -2)
    joints = tangent.child_turns @ P @ np.swapaxes(tangent.child_turns, -1, -2)
    segments += _BODY
    root = segments[tangent.root]
    twist = covariance[:6, :6].copy()
    if root_observed and dt_s > 0.0:
        # The difference of two poses whose errors are nearly the same.
        twist = 2.0 * (1.0 - np.exp(-dt_s / _CORRELATED_S)) / dt_s**2 * root
    return BodyUncertainty(root, twist, joints, segments)


def widened(uncertainty: BodyUncertainty) -> BodyUncertainty:
    """The covariances of a state whose fit did not converge: it may be anywhere near."""
    return replace(
        uncertainty,
        root=uncertainty.root + _UNCONVERGED,
        joints=uncertainty.joints + 2.0 * _UNCONVERGED[:3, :3],
        segments=uncertainty.segments + _UNCONVERGED,
    )
