"""Where the body has a camera that is lost: the pose, its covariance, and who is lost."""

import dataclasses

import numpy as np
import pytest
from moving_body import STEP_NS, body_with_cameras, frame_after, lenses, seen_by, true_poses

from bodycam_ros.geometry import exp_se3, inverse, log_se3
from bodycam_ros.solving.body_frame import BodyFrame
from bodycam_ros.solving.body_smoother import BodySmoother
from bodycam_ros.solving.body_state import BodyState
from bodycam_ros.solving.expected_cameras import ExpectedCameras, expected_camera
from bodycam_ros.timing.clock_state import ClockState

BODY = body_with_cameras()
LOST = "wrist"


def solved(frames: int, lost_from: int) -> list[BodyState]:
    """The body while one camera is lost from a frame on, without so much as a rotation."""
    smoother, random = BodySmoother(BODY, lenses(BODY)), np.random.default_rng(3)
    states: list[BodyState] = []
    for number in range(frames):
        frame = frame_after(BODY, number - 1, number, random)
        if number >= lost_from:
            frame = BodyFrame(frame.stamp_ns, {c: m for c, m in frame.matches.items() if c != LOST})
        states += smoother.update(frame)
    return states + smoother.flush()


@pytest.fixture(scope="module")
def states() -> list[BodyState]:
    return solved(40, lost_from=30)


def test_covariance_is_that_of_the_segment_moved_to_the_camera(states: list[BodyState]) -> None:
    state, mount, step = states[-1], BODY.mounts[LOST], 1e-6
    row = BODY.segment_index[mount.segment]
    segments = state.uncertainty.segments.copy()
    tilted = np.random.default_rng(1).normal(size=(6, 6))
    segments[row] = 1e-4 * tilted @ tilted.T  # no direction like another
    state = dataclasses.replace(state, uncertainty=dataclasses.replace(state.uncertainty, segments=segments))
    expected = expected_camera(LOST, mount, state, state.stamp_ns)
    world_T_segment = state.world_T_segment[row]
    np.testing.assert_allclose(expected.world_T_camera, world_T_segment @ mount.segment_T_camera)
    moved = [world_T_segment @ exp_se3(step * axis) @ mount.segment_T_camera for axis in np.eye(6)]
    J = np.stack([log_se3(inverse(expected.world_T_camera) @ pose) / step for pose in moved], axis=1)
    np.testing.assert_allclose(expected.covariance, J @ segments[row] @ J.T, rtol=1e-4, atol=1e-9)


def test_a_lost_camera_is_expected_where_it_is_though_less_surely(states: list[BodyState]) -> None:
    root = BODY.segment_index[BODY.root]
    for state in states:
        np.testing.assert_array_equal(state.uncertainty.segments[root], state.uncertainty.root)
    spread, errors = [], []
    for state in states[29:]:
        expected = expected_camera(LOST, BODY.mounts[LOST], state, state.stamp_ns)
        number = state.stamp_ns // STEP_NS - 1
        row = BODY.segment_index[BODY.mounts[LOST].segment]
        truth = true_poses(BODY, number)[row] @ BODY.mounts[LOST].segment_T_camera
        away = log_se3(inverse(expected.world_T_camera) @ truth)
        errors.append(away @ np.linalg.solve(expected.covariance, away) / 6)
        spread.append(np.trace(expected.covariance))
    assert np.all(np.diff(spread[:5]) > 0.0), "from image to image, until habit is all that is known of it"
    assert min(spread[5:]) > 100 * spread[0]
    assert np.median(errors) < 4.0, "within what is expected of it"


def test_stamps_are_of_the_cameras_own_clock(states: list[BodyState]) -> None:
    expected = ExpectedCameras(BODY)
    expected.hear(seen_by(BODY, LOST, 3, np.random.default_rng(0), lost=True))
    (told,) = expected.of(states[-1], {})
    assert (told.camera, told.stamp_ns) == (LOST, states[-1].stamp_ns)
    (told,) = expected.of(states[-1], {LOST: ClockState(0, 0, 0.02, 0.0, 1e-3, 1e-6)})
    assert told.stamp_ns == states[-1].stamp_ns + 20_000_000
