"""The estimator on a moving body whose truth is known: accuracy, gaps, blind cameras, wrong cameras."""

import numpy as np
import pytest
from helpers.moving_body import (
    STEP_NS,
    body_with_cameras,
    frame_after,
    lenses,
    position_errors,
    seen_by,
    true_poses,
)

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body_state import BodyFrame, BodyState
from bodycam_ros.camera import CameraModel
from bodycam_ros.estimation.estimator import BodyEstimator
from bodycam_ros.geometry import inverse, log_so3


@pytest.fixture(scope="module")
def body() -> BodyModel:
    return body_with_cameras()


@pytest.fixture(scope="module")
def cameras(body: BodyModel) -> dict[str, CameraModel]:
    return lenses(body)


def run(
    body, cameras, frames, settings=None, lost=lambda camera, frame: False, wrong=lambda camera, frame: False, seed=0
):
    """All states of a run, by frame number."""
    rng = np.random.default_rng(seed)
    estimator = BodyEstimator(body, cameras, settings)
    states: list[BodyState] = []
    for frame in range(frames):
        matches = {c: seen_by(body, c, frame, rng, lost(c, frame), wrong(c, frame)) for c in body.mounts}
        states += estimator.update(BodyFrame((frame + 1) * STEP_NS, matches))
    return {state.stamp_ns // STEP_NS - 1: state for state in states + estimator.flush()}


def joint_gaps(body: BodyModel, states: dict[int, BodyState]) -> np.ndarray:
    """Distances (T, J) [m] between the two ends of every joint."""
    poses = np.array([state.world_T_segment for state in states.values()])
    ends = [
        (
            poses[:, body.segment_index[joint.parent]] @ joint.parent_T_joint,
            poses[:, body.segment_index[joint.child]] @ joint.child_T_joint,
        )
        for joint in body.joints
    ]
    return np.stack([np.linalg.norm(a[:, :3, 3] - b[:, :3, 3], axis=1) for a, b in ends], axis=1)


def test_follows_the_body_and_holds_the_joints(body, cameras) -> None:
    states = run(body, cameras, 60)
    assert list(states) == list(range(60))
    errors = position_errors(body, states)
    # One camera alone errs by 4 mm an axis, 7 mm in all.
    assert errors.mean() < 0.005
    assert joint_gaps(body, states).max() < 1e-9
    assert all(state.cameras_used == 4 and not state.predicted for state in states.values())


def test_the_covariance_of_the_root_tells_its_scatter(body, cameras) -> None:
    normalised = []
    for seed in range(8):
        states = run(body, cameras, 25, seed=seed)
        for frame in range(5, 25, 5):
            error = inverse(true_poses(body, frame)[0]) @ states[frame].world_T_segment[0]
            xi = np.concatenate([log_so3(error[:3, :3]), error[:3, 3]])
            normalised.append(xi @ np.linalg.solve(states[frame].uncertainty.root, xi))
    # Chi-square of 6 degrees of freedom; a covariance wrong by a factor of three would fail.
    assert 2.0 < np.mean(normalised) < 12.0


def test_a_blind_limb_keeps_its_orientation(body, cameras) -> None:
    def lost(camera: str, frame: int) -> bool:
        return camera == "wrist" and 20 <= frame < 35

    states = run(body, cameras, 60, lost=lost)
    for frame in range(20, 35):
        error = true_poses(body, frame)[2][:3, :3].T @ states[frame].world_T_segment[2][:3, :3]
        assert np.degrees(np.linalg.norm(log_so3(error))) < 5.0
    assert position_errors(body, states).max() < 0.03


def test_a_wrong_registration_does_not_bend_the_limb(body, cameras) -> None:
    states = run(body, cameras, 60, wrong=lambda camera, frame: camera == "arm" and frame in (20, 21, 40))
    assert position_errors(body, states).max() < 0.03


def test_irregular_stamps_and_a_long_pause(body, cameras) -> None:
    rng = np.random.default_rng(0)
    estimator = BodyEstimator(body, cameras)
    states: list[BodyState] = []
    frames = (*range(0, 20), *range(21, 30, 2), *range(90, 110))
    for before, frame in zip((-1, *frames), frames, strict=False):
        states += estimator.update(frame_after(body, before, frame, rng))
    by_frame = {round(state.stamp_ns / STEP_NS) - 1: state for state in states + estimator.flush()}
    # Every second image is missed for a while; nothing reaches across the two seconds that follow.
    assert list(by_frame) == [*range(0, 30), *range(90, 110)]
    assert [frame for frame, state in by_frame.items() if state.predicted] == [20, 22, 24, 26, 28]
    assert position_errors(body, by_frame).max() < 0.03


def test_a_silence_of_all_cameras_is_bridged_and_flagged(body, cameras) -> None:
    rng = np.random.default_rng(0)
    estimator = BodyEstimator(body, cameras)
    frames = (*range(30), *range(45, 60))
    states: list[BodyState] = []
    for before, frame in zip((-1, *frames), frames, strict=False):
        states += estimator.update(frame_after(body, before, frame, rng))
    by_frame = {round(state.stamp_ns / STEP_NS) - 1: state for state in states + estimator.flush()}
    assert list(by_frame) == list(range(60)) and estimator.counts.interpolated == 15
    silent = {frame: state for frame, state in by_frame.items() if 30 <= frame < 45}
    assert all(state.predicted and not state.observed.any() for state in silent.values())
    assert position_errors(body, silent).max() < 0.06
    assert joint_gaps(body, silent).max() < 1e-9
    # Surest at its ends, and less sure than while cameras spoke.
    spread = [float(np.trace(state.uncertainty.root)) for state in silent.values()]
    assert spread[7] > 2 * spread[0] > 2 * np.trace(by_frame[29].uncertainty.root)
