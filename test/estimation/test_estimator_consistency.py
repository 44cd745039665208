"""The estimator without outliers: exact data, noise of known size, and errors against published covariances (NEES).

The motion is drawn from the motion prior itself, so that all that the estimator assumes is true: its normalised
estimation errors squared then have a chi-square distribution. A published covariance is that given all measurements
until its state, so it is exact without a delay, and an upper bound with one; the window's own marginal is exact.
"""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from helpers.motion_of_the_prior import STEP_NS, drawn_motion, measured_frames
from helpers.moving_body import body_with_cameras, true_poses
from scipy.stats import chi2

from bodycam_ros.body_state import BodyState
from bodycam_ros.estimation.estimator import BodyEstimator
from bodycam_ros.estimation.estimator_settings import OFFLINE, EstimatorSettings
from bodycam_ros.estimation.factors.camera_poses import KERNEL
from bodycam_ros.estimation.motion_settings import MotionSettings
from bodycam_ros.estimation.mounted_cameras import EvidenceSettings, evidence_floor
from bodycam_ros.estimation.uncertainty import _BODY
from bodycam_ros.geometry import Array, exp_so3, inverse, log_se3, log_so3

BODY = body_with_cameras()
DELAYS = (0, 4, OFFLINE)
_TILTED = exp_so3(np.array([0.6, 0.3, -0.9]))
STATED = np.zeros((6, 6))
STATED[:3, :3] = _TILTED @ np.diag([0.001, 0.004, 0.002]) ** 2 @ _TILTED.T
STATED[3:, 3:] = _TILTED @ np.diag([0.002, 0.008, 0.004]) ** 2 @ _TILTED.T
"""Covariance of a registration: other in each direction of the camera, and of the segment."""

NOISE = STATED + evidence_floor(EvidenceSettings())
"""What the estimator takes it for: map, lens and strap err besides."""

WEIGHT = 1.0 / (1.0 + 6.0 / KERNEL**2)
"""Mean weight by Cauchy's loss of a camera whose six errors are normal: so much of its information is used."""

RUNS, FRAMES = 8, 60
JUDGED = range(10, FRAMES, 4)  # errors of states so far apart have little in common


def solve(
    world_T_segment: Array, stated: Array, noise: Array, delay: int | str, seed: int = 0
) -> tuple[list[BodyState], BodyEstimator]:
    """All states of a motion (T, S, 4, 4), and their estimator."""
    settings = EstimatorSettings(output_delay=delay)
    estimator = BodyEstimator(BODY, list(BODY.mounts), settings, offline=delay == OFFLINE)
    states: list[BodyState] = []
    for frame in measured_frames(BODY, world_T_segment, stated, noise, np.random.default_rng(seed)):
        states += estimator.update(frame)
    states += estimator.flush()
    assert [state.stamp_ns for state in states] == [(row + 1) * STEP_NS for row in range(len(world_T_segment))]
    return states, estimator


@dataclass(frozen=True)
class Run:
    """A motion, and what was solved of it."""

    world_T_segment: Array
    states: list[BodyState]
    estimator: BodyEstimator
    delay: int | str


@pytest.fixture(scope="module")
def motions() -> list[Array]:
    return [drawn_motion(BODY, FRAMES, np.random.default_rng(100 + seed), MotionSettings()) for seed in range(RUNS)]


@pytest.fixture(scope="module", params=DELAYS, ids=str)
def runs(request: pytest.FixtureRequest, motions: list[Array]) -> list[Run]:
    """Motions with noise as the estimator assumes it."""
    solved = [(true, *solve(true, STATED, NOISE, request.param, seed)) for seed, true in enumerate(motions)]
    return [Run(*each, request.param) for each in solved]


def assert_chi_square(squares: list[float], degrees: int, at_most: bool = False) -> None:
    """Squared normalised errors of some degrees of freedom each are as large as they should be, or at most so large."""
    low, high = WEIGHT * chi2.ppf([0.001, 0.999], degrees * len(squares)) / len(squares)
    assert (at_most or low < np.mean(squares)) and np.mean(squares) < high, (
        f"{np.mean(squares):.2f}, expected {low:.2f} to {high:.2f}"
    )


@pytest.mark.parametrize("segment", BODY.segments)
def test_errors_of_segments_are_as_large_as_published(runs: list[Run], segment: str) -> None:
    row, squares = BODY.segment_index[segment], []
    for run in runs:
        for frame in JUDGED:
            state = run.states[frame]
            error = log_se3(inverse(run.world_T_segment[frame, row]) @ state.world_T_segment[row])
            covariance = state.uncertainty.segments[row] - _BODY  # the body is exact here
            squares.append(float(error @ np.linalg.solve(covariance, error)))
    assert_chi_square(squares, 6, at_most=runs[0].delay != 0)


def test_errors_of_joints_are_as_large_as_published(runs: list[Run]) -> None:
    shoulder, elbow = (BODY.joint_row[name] for name in ("shoulder", "elbow"))
    axis = BODY.tree_joints[elbow].axis
    axis = axis / np.linalg.norm(axis)
    balls, hinges = [], []
    for run in runs:
        for frame in JUDGED:
            state = run.states[frame]
            true, found = BODY.joint_rotations(run.world_T_segment[frame]), BODY.joint_rotations(state.world_T_segment)
            errors, covariances = log_so3(np.swapaxes(true, 1, 2) @ found), state.uncertainty.joints
            balls.append(float(errors[shoulder] @ np.linalg.solve(covariances[shoulder], errors[shoulder])))
            hinges.append(float((axis @ errors[elbow]) ** 2 / (axis @ covariances[elbow] @ axis)))
    assert_chi_square(balls, 3, at_most=runs[0].delay != 0)
    assert_chi_square(hinges, 1, at_most=runs[0].delay != 0)


def test_the_marginals_of_a_window_are_exact(motions: list[Array]) -> None:
    """All coordinates of states that later frames have changed: root, ball and hinge at once."""
    squares = []
    for seed, true in enumerate(motions):
        estimator = BodyEstimator(BODY, list(BODY.mounts), EstimatorSettings(output_delay=FRAMES))
        for frame in measured_frames(BODY, true, STATED, NOISE, np.random.default_rng(seed)):
            assert estimator.update(frame) == []
        for number in JUDGED:
            at, root = estimator._window.at(number), estimator._window.square_root(number)
            K = at.tangent.count
            off = at.step_to(replace(at, motion=BODY.motion_of(true[number], at.tangent.slides)))
            squares.append(float(np.sum((root[K:, K:] @ off) ** 2)))
    assert K == 10
    assert_chi_square(squares, K)


def test_without_outliers_nothing_is_rejected(runs: list[Run]) -> None:
    for run in runs:
        assert all(state.cameras_used == len(BODY.mounts) and state.converged for state in run.states)
        counts = run.estimator.counts
        assert not counts.rejected and counts.contradictory == counts.unconverged == counts.interpolated == 0


def test_errors_are_smaller_than_those_of_a_camera_alone(runs: list[Run]) -> None:
    """The trunk has two cameras, of which either is a mean of both and of the motion."""
    root = BODY.segment_index[BODY.root]
    errors = np.array(
        [
            log_se3(inverse(run.world_T_segment[frame, root]) @ run.states[frame].world_T_segment[root])
            for run in runs
            for frame in JUDGED
        ]
    )
    alone = np.sqrt(np.diag(NOISE))
    assert (errors.std(axis=0) < 0.85 * alone).all()
    # No direction is favoured: the mean over all is zero within its own scatter.
    assert (np.abs(errors.mean(axis=0)) < 4.0 * errors.std(axis=0) / np.sqrt(len(errors))).all()


@pytest.mark.parametrize("factor", [0.5, 2.0])
def test_sigmas_that_are_wrong_by_a_factor_are_noticed(motions: list[Array], factor: float) -> None:
    """The tests above can fail."""
    squares = []
    for seed, true in enumerate(motions[:4]):
        states, _ = solve(true, STATED, factor**2 * NOISE, 0, seed)
        for frame in JUDGED:
            error = log_se3(inverse(true[frame, 0]) @ states[frame].world_T_segment[0])
            squares.append(float(error @ np.linalg.solve(states[frame].uncertainty.segments[0] - _BODY, error)))
    with pytest.raises(AssertionError):
        assert_chi_square(squares, 6)


@pytest.mark.parametrize("delay", DELAYS)
@pytest.mark.parametrize("motion", ["walking", "drawn"])
def test_exact_registrations_of_small_sigma_give_the_exact_body(delay: int | str, motion: str) -> None:
    frames = 30
    if motion == "drawn":
        true = drawn_motion(BODY, frames, np.random.default_rng(7), MotionSettings())
    else:
        true = np.array([true_poses(BODY, frame) for frame in range(frames)])
    states, _ = solve(true, 1e-4 * STATED, np.zeros((6, 6)), delay)
    found = np.array([state.world_T_segment for state in states])
    errors = log_se3(inverse(true) @ found)
    # The prior pulls by a share of the sigma, which has a floor of 0.4 mrad and 1 mm.
    assert np.abs(errors[..., :3]).max() < 4e-4 and np.abs(errors[..., 3:]).max() < 1e-3


@pytest.mark.parametrize("delay", DELAYS)
def test_a_body_at_rest_comes_to_rest(delay: int | str) -> None:
    still = np.tile(BODY.n_pose(np.eye(4)), (FRAMES, 1, 1, 1))
    states, _ = solve(still, STATED, np.zeros((6, 6)), delay)
    found = np.array([state.world_T_segment for state in states])
    np.testing.assert_allclose(found, still, atol=1e-6)
    assert all(state.observed.all() for state in states)


def test_a_longer_window_errs_less(motions: list[Array]) -> None:
    """Frames that follow a state improve it."""
    errors = []
    for delay in (0, 4):
        squares = []
        for seed, true in enumerate(motions[:4]):
            states, _ = solve(true, STATED, NOISE, delay, seed)
            found = np.array([state.world_T_segment for state in states])
            squares.append(np.mean((found[..., :3, 3] - true[..., :3, 3])[10:-5] ** 2))
        errors.append(np.sqrt(np.mean(squares)))
    assert errors[1] < 0.95 * errors[0]
