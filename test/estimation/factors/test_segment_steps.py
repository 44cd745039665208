"""Measurements of one segment in two states: their Jacobians by differences, and their sigmas."""

from dataclasses import replace

import gtsam
import numpy as np
import pytest
from helpers.moving_body import body_with_cameras, true_poses
from helpers.numeric_factor import assert_linearised, numeric_jacobian

from bodycam_ros.estimation.coordinates import Chart, Coordinates
from bodycam_ros.estimation.factors.factor import on_step
from bodycam_ros.estimation.factors.inertial_step import InertialStep
from bodycam_ros.estimation.factors.joint_rotations import SLIDES_M
from bodycam_ros.estimation.factors.resting_point import RestingPoint
from bodycam_ros.estimation.factors.segment_steps import SegmentStep, SegmentSteps
from bodycam_ros.estimation.factors.segment_turn import SegmentTurn
from bodycam_ros.geometry import exp_se3, exp_so3
from bodycam_ros.kinematics.tangent import TreeTangent

RNG = np.random.default_rng(2)
PLACE = RNG.normal(size=3)
BEFORE, STEP = exp_se3(RNG.normal(size=6)), RNG.normal(scale=0.2, size=6)
AFTER = BEFORE @ exp_se3(STEP)
TWISTS = RNG.normal(size=(2, 6))
INERTIAL = InertialStep(
    0,
    PLACE,
    0.2,
    *RNG.normal(size=(4, 3)),
    density=1e-4,
    sigma=0.01,
    with_position=True,
)
TURN = SegmentTurn(1, exp_so3(STEP[:3] + 0.3), 0.01)
POINT = RestingPoint(2, PLACE, 0.3)


@pytest.mark.parametrize("step", [TURN, POINT, INERTIAL], ids=["turn", "point", "inertial"])
def test_jacobians_are_numeric_ones(step: SegmentStep) -> None:
    _, by_before, by_after = step.residual(BEFORE, AFTER, *TWISTS)
    for end, jacobian in ((0, by_before), (1, by_after)):

        def moved(change: np.ndarray, end: int = end) -> np.ndarray:
            poses, twists = [BEFORE, AFTER], TWISTS.copy()
            poses[end], twists[end] = poses[end] @ exp_se3(change[:6]), twists[end] + change[6:]
            return step.residual(*poses, *twists)[0]

        np.testing.assert_allclose(jacobian, numeric_jacobian(moved, 12), rtol=1e-4, atol=1e-3)


def test_a_turn_that_is_as_measured_has_no_error() -> None:
    exact = SegmentTurn(0, BEFORE[:3, :3].T @ AFTER[:3, :3], 0.01)
    np.testing.assert_allclose(exact.residual(BEFORE, AFTER)[0], 0.0, atol=1e-9)


def test_an_inertial_step_is_in_sigmas() -> None:
    """By the covariance of velocity and place: noise of the acceleration, and errors of both beside it."""
    dt = 0.2
    density = 1e-4
    sigma = 0.01
    exact = InertialStep(0, PLACE, dt, *np.zeros((4, 3)), density=density, sigma=sigma, with_position=True)
    twists = np.zeros((2, 6))
    # Residuals are linear in what was preintegrated: the steps of each make the square root of the information.
    left = exact.residual(BEFORE, AFTER, *twists)[0]
    columns = []
    for axis in np.eye(6):
        moved = replace(exact, velocity=axis[:3], position=axis[3:])
        columns.append(moved.residual(BEFORE, AFTER, *twists)[0] - left)
    of_noise = density * np.array([[dt, dt**2 / 2.0], [dt**2 / 2.0, dt**3 / 3.0]])
    beside = np.diag([sigma**2, (0.5 * sigma * dt) ** 2])
    W = np.column_stack(columns)
    np.testing.assert_allclose(np.linalg.inv(W.T @ W), np.kron(of_noise + beside, np.eye(3)), rtol=1e-9, atol=1e-15)


def test_stacked_they_are_one_factor_of_two_states() -> None:
    """By the coordinates of the tree, away from the origins of both charts."""
    body = body_with_cameras()
    tangent = TreeTangent(body, SLIDES_M)
    charts = []
    for frame in (7, 8):
        motion = body.motion_of(true_poses(body, frame))
        charts.append(Chart(Coordinates(tangent, motion, np.zeros(tangent.count))))
    factor = on_step((0, 1), (charts[0], charts[1]), SegmentSteps([TURN, POINT]))
    values = gtsam.Values()
    for key in (0, 1):
        values.insert(key, RNG.normal(scale=0.4, size=2 * tangent.count))
    assert_linearised(factor, values, 2e-4)
