"""What is measured of two instants: Jacobians by differences, and turns that are told."""

from dataclasses import replace

import numpy as np
import pytest

from bodycam_ros.estimation.between_factors import InertialStep, RestingPoint, SegmentTurn
from bodycam_ros.estimation.estimate import Between
from bodycam_ros.geometry import exp_se3, exp_so3

SMALL = 1e-6
RNG = np.random.default_rng(2)
PLACE = RNG.normal(size=3)
BEFORE, STEP = exp_se3(RNG.normal(size=6)), RNG.normal(scale=0.2, size=6)


@pytest.mark.parametrize(
    "measured",
    [
        SegmentTurn(0, exp_so3(STEP[:3]), 0.01),
        RestingPoint(0, PLACE, 0.3),
    ],
)
def test_residuals_lessen_as_their_jacobians_say(measured: Between) -> None:
    after = BEFORE @ exp_se3(STEP)
    if isinstance(measured, SegmentTurn):
        after[:3, :3] = BEFORE[:3, :3] @ exp_so3(-STEP[:3])  # exact where nothing is left of the turn
        measured = SegmentTurn(0, BEFORE[:3, :3].T @ after[:3, :3], 0.01)
    _, by_after, by_before = measured.residual(BEFORE, after)
    for axis in range(6):
        step = SMALL * np.eye(6)[axis]
        for by, ends in (
            (by_after, [(BEFORE, after @ exp_se3(sign * step)) for sign in (1.0, -1.0)]),
            (by_before, [(BEFORE @ exp_se3(sign * step), after) for sign in (1.0, -1.0)]),
        ):
            late, early = (measured.residual(*end)[0] for end in ends)
            np.testing.assert_allclose(by[:, axis], -(late - early) / (2.0 * SMALL), atol=1e-5)


def test_an_inertial_step_lessens_as_its_jacobians_say() -> None:
    twists = RNG.normal(size=(2, 6))
    spins = RNG.normal(size=(2, 3))
    step = InertialStep(
        0, PLACE, 0.2, RNG.normal(size=3), RNG.normal(size=3), *spins, density=1e-4, sigma=0.01, with_position=True
    )
    after = BEFORE @ exp_se3(STEP)
    _, by_after, by_before = step.residual(BEFORE, after, *twists)
    for column in range(12):
        xi, velocity = SMALL * np.eye(12)[column, :6], SMALL * np.eye(12)[column, 6:]
        for by, end in ((by_before, 0), (by_after, 1)):
            off = []
            for sign in (1.0, -1.0):
                poses, moved = [BEFORE, after], twists.copy()
                poses[end], moved[end] = poses[end] @ exp_se3(sign * xi), moved[end] + sign * velocity
                off.append(step.residual(*poses, *moved)[0])
            numeric = -(off[0] - off[1]) / (2.0 * SMALL)
            np.testing.assert_allclose(by[:, column], numeric, rtol=1e-4, atol=1e-3)


def test_an_inertial_step_is_in_sigmas() -> None:
    """By the covariance of velocity and place: noise of the acceleration, and errors of both beside it."""
    dt, density, sigma = 0.2, 1e-4, 0.01
    exact = InertialStep(0, PLACE, dt, *np.zeros((4, 3)), density=density, sigma=sigma, with_position=True)
    twists, after = np.zeros((2, 6)), BEFORE @ exp_se3(STEP)
    # Residuals are linear in what was preintegrated: the steps of each make the square root of the information.
    left = exact.residual(BEFORE, after, *twists)[0]
    columns = []
    for axis in np.eye(6):
        moved = replace(exact, velocity=axis[:3], position=axis[3:])
        columns.append(moved.residual(BEFORE, after, *twists)[0] - left)
    of_noise = density * np.array([[dt, dt**2 / 2.0], [dt**2 / 2.0, dt**3 / 3.0]])
    beside = np.diag([sigma**2, (0.5 * sigma * dt) ** 2])
    W = np.column_stack(columns)
    np.testing.assert_allclose(np.linalg.inv(W.T @ W), np.kron(of_noise + beside, np.eye(3)), rtol=1e-9, atol=1e-15)
