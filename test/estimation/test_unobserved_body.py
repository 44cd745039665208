"""What cameras, rates and settings must not do to the solver, on the synthetic body of ``test_body_estimator``."""

import dataclasses
from dataclasses import replace

import numpy as np
import pytest
from helpers.moving_body import STEP_NS, body_with_cameras, frame_after, lenses, position_errors, seen_by

from bodycam_ros.body.body_model import BodyModel, CameraMount
from bodycam_ros.body_state import BodyFrame, BodyState
from bodycam_ros.estimation import solved_state as solved_state_module
from bodycam_ros.estimation.estimator import BodyEstimator
from bodycam_ros.estimation.estimator_settings import EstimatorSettings
from bodycam_ros.estimation.motion_settings import MotionSettings
from bodycam_ros.geometry import exp_se3, exp_so3, log_so3, rigid
from bodycam_ros.kinematics.joint import Joint
from bodycam_ros.pipeline.settings import PipelineSettings
from bodycam_ros.pipeline.skeleton import SkeletonPipeline
from bodycam_ros.registration.landmark_matches import LandmarkMatches


def solve(estimator: BodyEstimator, frames: list[BodyFrame]) -> list[BodyState]:
    states = [state for frame in frames for state in estimator.update(frame)]
    return states + estimator.flush()


def seen_frames(body: BodyModel, numbers: range, cameras: set[str]) -> list[BodyFrame]:
    """Frames that only some cameras speak in."""
    rng = np.random.default_rng(0)
    frames = [frame_after(body, before, n, rng) for before, n in zip((-1, *numbers), numbers, strict=False)]
    return [
        dataclasses.replace(frame, matches={c: m for c, m in frame.matches.items() if c in cameras}) for frame in frames
    ]


@pytest.mark.parametrize("every", [1, 5, 15])
@pytest.mark.parametrize("cameras", [{"wrist"}, {"back", "arm"}])
def test_no_rate_and_no_missing_camera_ends_it(every: int, cameras: set[str]) -> None:
    body = body_with_cameras()
    frames = seen_frames(body, range(0, 90, every), cameras)
    estimator = BodyEstimator(body, lenses(body))
    states = solve(estimator, frames)
    assert [state.stamp_ns for state in states] == [frame.stamp_ns for frame in frames]
    assert np.isfinite([state.world_T_segment for state in states]).all()
    on_body = {body.mounts[camera].segment for camera in cameras}
    for state in states:
        assert {s for s, seen in zip(state.segments, state.observed, strict=True) if seen} == on_body


@pytest.mark.parametrize(("linear", "angular"), [(1000.0, 5000.0), (0.1, 0.1)])
@pytest.mark.parametrize("cameras", [{"chest"}, {"chest", "back", "arm", "wrist"}])
def test_no_setting_ends_it_and_no_instant_is_lost(linear: float, angular: float, cameras: set[str]) -> None:
    body = body_with_cameras()
    motion = MotionSettings(acceleration_sigma=linear, angular_acceleration_sigma=angular)
    frames = seen_frames(body, range(60), cameras)
    states = solve(BodyEstimator(body, lenses(body), motion=motion), frames)
    assert [state.stamp_ns for state in states] == [frame.stamp_ns for frame in frames]
    assert np.isfinite([state.world_T_segment for state in states]).all()


@pytest.mark.parametrize("cameras", [{"wrist"}, {"chest", "back", "arm", "wrist"}])
def test_a_registration_in_another_country_is_rejected(cameras: set[str]) -> None:
    """Ten kilometres off, it ended the recording in gtsam."""
    body, rng = body_with_cameras(), np.random.default_rng(0)
    frames, away = list[BodyFrame](), rigid(np.eye(3), np.array([1e4, 1e6, 0.0]))
    for number in range(30):
        matches = {camera: seen_by(body, camera, number, rng) for camera in body.mounts}
        for camera in cameras if number in range(10, 13) else set[str]():
            pose = matches[camera].world_T_camera
            assert pose is not None
            matches[camera] = dataclasses.replace(matches[camera], world_T_camera=away @ pose)
        frames.append(BodyFrame((number + 1) * STEP_NS, matches))
    estimator = BodyEstimator(body, lenses(body))
    states = solve(estimator, frames)
    assert estimator.counts.rejected == dict.fromkeys(cameras, 3)
    assert position_errors(body, dict(enumerate(states))).max() < 0.1


@pytest.mark.parametrize("offline", [False, True])
def test_a_body_that_no_camera_sees_does_not_make_the_window_grow(
    monkeypatch: pytest.MonkeyPatch, offline: bool
) -> None:
    """All states waited for it, and every one took longer than the one before."""
    monkeypatch.setattr(solved_state_module, "_BLIND_WAIT_S", 1.0)
    body, rng = body_with_cameras(), np.random.default_rng(0)
    estimator = BodyEstimator(body, lenses(body), offline=offline)
    published = list[int]()
    for number in range(120):
        matches = {camera: seen_by(body, camera, number, rng, lost=number >= 30) for camera in body.mounts}
        published += [state.stamp_ns for state in estimator.update(BodyFrame((number + 1) * STEP_NS, matches))]
    assert published == [(number + 1) * STEP_NS for number in range(89)]


@pytest.mark.parametrize("camera", ["chest", "wrist"])
def test_registrations_that_are_noise_are_survived(camera: str) -> None:
    body = body_with_cameras()
    rng = np.random.default_rng(1)
    frames = []
    for frame in seen_frames(body, range(60), set(body.mounts)):
        matches = dict(frame.matches)
        pose = matches[camera].world_T_camera @ exp_se3(rng.normal(0.0, 1.0, 6))
        matches[camera] = dataclasses.replace(matches[camera], world_T_camera=pose)
        frames.append(BodyFrame(frame.stamp_ns, matches))
    estimator = BodyEstimator(body, lenses(body))
    states = solve(estimator, frames)
    counts = estimator.counts.rejected
    assert counts[camera] > 50 and sum(counts.values()) < 70
    by_frame = {round(state.stamp_ns / STEP_NS) - 1: state for state in states}
    chest = position_errors(body, by_frame)[:, 0]
    assert chest.max() < 0.03


def test_the_covariance_grows_while_nothing_is_seen_and_shrinks_again() -> None:
    body = body_with_cameras()
    rng = np.random.default_rng(0)
    frames = [frame_after(body, number - 1, number, rng) for number in range(60)]
    blind = [
        frame
        if not 20 <= number < 40
        else dataclasses.replace(frame, matches={c: _lost(m) for c, m in frame.matches.items()})
        for number, frame in enumerate(frames)
    ]
    states = solve(BodyEstimator(body, lenses(body), EstimatorSettings(output_delay=0)), blind)
    root = [float(np.sqrt(np.trace(state.uncertainty.root[3:, 3:]))) for state in states]
    joints = [float(np.sqrt(np.trace(state.uncertainty.joints[0]))) for state in states]
    twist = [float(np.trace(state.uncertainty.root_twist)) for state in states]
    assert all(later > earlier for earlier, later in zip(root[20:39], root[21:40], strict=True))
    assert root[39] > 30 * root[19] and joints[39] > 3 * joints[19] and twist[39] > 3 * twist[19]
    assert root[45] < 1.5 * root[19]
    assert [state.predicted for state in states] == [20 <= number < 40 for number in range(60)]


def _lost(matches: LandmarkMatches) -> LandmarkMatches:
    return dataclasses.replace(matches, world_T_camera=None, rotation_inliers=0, current_R_previous=np.eye(3))


def test_counts_are_of_the_whole_recording_when_its_time_begins_anew() -> None:
    body, rng = body_with_cameras(), np.random.default_rng(0)
    frames = [
        BodyFrame((n + 1) * STEP_NS, {c: seen_by(body, c, n, rng, wrong=c == "back") for c in body.mounts})
        for n in range(30)
    ]
    pipeline = SkeletonPipeline(body, lenses(body), PipelineSettings(), live=True)
    pipeline._solve(frames)
    once = pipeline.counts.rejected["back"]
    pipeline._solve([replace(frames[0], is_earlier=True), *frames[1:]])
    assert once > 0
    assert pipeline.counts.rejected["back"] == 2 * once


def leg_of(cameras: dict[str, str]) -> BodyModel:
    """Pelvis, thigh, shin and foot, with limits as a range of motion leaves them; camera -> its segment."""
    below = rigid(np.eye(3), np.array([0.0, 0.0, -0.42]))
    ranges = {
        "hip": ((-1.3, 0.3), (-0.5, 0.5), (-0.7, 0.2)),
        "knee": ((-0.09, 1.7), (-0.09, 0.09), (-0.09, 0.09)),
        "ankle": ((-0.6, 0.6), (-0.4, 0.4), (-0.4, 0.4)),
    }
    chain = ("pelvis", "thigh_left", "shin_left", "foot_left")
    joints = tuple(
        Joint(name, parent, child, "ball", np.eye(4) if name == "hip" else below, angle_axes="yxz", limits=limits)
        for (name, limits), parent, child in zip(ranges.items(), chain[:-1], chain[1:], strict=True)
    )
    mounts = {camera: CameraMount(segment, np.eye(4)) for camera, segment in cameras.items()}
    return BodyModel("leg", "pelvis", chain, joints, mounts)


@pytest.mark.parametrize("flexion", [0.3, 0.6, 1.0])
def test_a_knee_of_which_only_the_foot_is_seen_bends_forwards(flexion: float) -> None:
    body = leg_of({"waist": "pelvis", "foot": "foot_left"})
    turns = exp_so3(np.array([[0.0, angle, 0.0] for angle in (-flexion / 3.0, flexion, -2.0 * flexion / 3.0)]))
    true = body.forward_kinematics(np.eye(4), turns)
    any_matches = seen_by(body_with_cameras(), "chest", 0, np.random.default_rng(0))
    matches = {
        camera: dataclasses.replace(
            any_matches, camera=camera, world_T_camera=true[body.segment_index[mount.segment]], rotation_inliers=0
        )
        for camera, mount in body.mounts.items()
    }
    states = solve(BodyEstimator(body, lenses(body)), [BodyFrame(STEP_NS, matches)])
    knee = body.joint_rotations(states[0].world_T_segment)[1]
    assert np.linalg.norm(log_so3(knee) - [0.0, flexion, 0.0]) < 0.15
