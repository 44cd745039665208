"""The motion over three instants: its derivatives against numeric ones, and what it calls smooth."""

import numpy as np
import pytest
from bodycam_ros.estimation.smooth_motion import MotionLimits, SmoothMotion

from bodycam_ros.estimation.motion_model import MotionSettings
from bodycam_ros.geometry import exp_se3

STAMPS_NS = np.array([0, 33, 71, 100], np.int64) * 1_000_000
MOTION = MotionLimits.of(MotionSettings(), 2)


def wandering(rng: np.random.Generator) -> np.ndarray:
    """Poses (T, S, 4, 4) that turn and move by large steps."""
    poses = [exp_se3(rng.normal(size=(2, 6)))]
    for _ in STAMPS_NS[1:]:
        poses.append(poses[-1] @ exp_se3(0.15 * rng.normal(size=(2, 6))))
    return np.array(poses)


def test_derivatives_are_those_of_the_deviations() -> None:
    poses, smooth = wandering(np.random.default_rng(1)), SmoothMotion(MOTION, STAMPS_NS)
    A, b = smooth.linearised(poses, 0).jacobian()
    numeric, step = np.zeros(A.shape[1]), 1e-6
    for column in range(A.shape[1]):
        xi = np.zeros(A.shape[1])
        xi[column] = step
        there, back = (poses @ exp_se3(sign * xi.reshape(*poses.shape[:2], 6)) for sign in (1.0, -1.0))
        numeric[column] = (smooth.error(there) - smooth.error(back)) / (2.0 * step)
    assert smooth.error(poses) == pytest.approx(0.5 * b @ b)
    # The gradient of half the squares; the derivatives are a series, exact to the fourth order of a step.
    np.testing.assert_allclose(-A.T @ b, numeric, rtol=2e-4, atol=1e-4 * np.abs(numeric).max())
