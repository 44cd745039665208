"""The whole recording known from both sides: against what is known at once, in blocks, and across their borders."""

import numpy as np
import pytest
from helpers.moving_body import STEP_NS, body_with_cameras, lenses, position_errors, seen_by, true_poses

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body_state import BodyFrame, BodyState
from bodycam_ros.camera import CameraModel
from bodycam_ros.estimation import solved_state as solved_state_module
from bodycam_ros.estimation.estimator import BodyEstimator
from bodycam_ros.estimation.estimator_settings import EstimatorSettings
from bodycam_ros.geometry import log_so3

OFFLINE = EstimatorSettings(output_delay="offline")
BLOCK_S, OVERLAP_S = 1.0, 0.5
FRAMES = 120


@pytest.fixture(scope="module")
def body() -> BodyModel:
    return body_with_cameras()


@pytest.fixture(scope="module")
def cameras(body: BodyModel) -> dict[str, CameraModel]:
    return lenses(body)


def run(
    body: BodyModel,
    cameras: dict[str, CameraModel],
    settings: EstimatorSettings,
    lost=lambda camera, frame: False,
    gone=lambda frame: False,
    heard=lambda share: None,
) -> dict[int, BodyState]:
    """All states of a run, by frame number."""
    rng = np.random.default_rng(3)
    estimator = BodyEstimator(body, cameras, settings, offline=True, on_progress=heard)
    states: list[BodyState] = []
    for frame in range(FRAMES):
        matches = {c: seen_by(body, c, frame, rng, lost(c, frame)) for c in body.mounts}
        if not gone(frame):
            states += estimator.update(BodyFrame((frame + 1) * STEP_NS, matches))
    states += estimator.flush()
    stamps_ns = [state.stamp_ns for state in states]
    assert stamps_ns == sorted(set(stamps_ns))
    return {round(state.stamp_ns / STEP_NS) - 1: state for state in states}


def turned_wrong(body: BodyModel, states: dict[int, BodyState], row: int, frames: range) -> np.ndarray:
    """Errors (F,) [rad] of a segment's rotation."""
    ours = np.array([states[frame].world_T_segment[row, :3, :3] for frame in frames])
    truth = np.array([true_poses(body, frame)[row, :3, :3] for frame in frames])
    return np.linalg.norm(log_so3(np.swapaxes(ours, -1, -2) @ truth), axis=-1)


def test_knows_more_than_what_came_before(body, cameras) -> None:
    at_once = run(body, cameras, EstimatorSettings(output_delay=0))
    later = run(body, cameras, EstimatorSettings(output_delay=4))
    whole = run(body, cameras, OFFLINE)
    assert list(whole) == list(at_once) == list(range(FRAMES))
    filtered, delayed, smoothed = (position_errors(body, states).mean() for states in (at_once, later, whole))
    assert smoothed < 0.95 * filtered and smoothed < 1.005 * delayed
    assert all(state.cameras_used == 4 for state in whole.values())


@pytest.fixture
def short_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(solved_state_module, "_BLOCK_S", BLOCK_S)
    monkeypatch.setattr(solved_state_module, "_OVERLAP_S", OVERLAP_S)


def test_blocks_are_the_whole(body, cameras, monkeypatch) -> None:
    """Published one after the other, and not kept until the recording is over."""
    whole = run(body, cameras, OFFLINE)
    monkeypatch.setattr(solved_state_module, "_BLOCK_S", BLOCK_S)
    monkeypatch.setattr(solved_state_module, "_OVERLAP_S", OVERLAP_S)
    blocks = run(body, cameras, OFFLINE)
    gaps = np.array([np.abs(whole[f].world_T_segment - blocks[f].world_T_segment).max() for f in range(FRAMES)])
    scatter = position_errors(body, whole).mean()
    assert gaps.max() < 0.05 * scatter
    estimator = BodyEstimator(body, cameras, OFFLINE, offline=True)
    rng = np.random.default_rng(3)
    frames = (BodyFrame((f + 1) * STEP_NS, {c: seen_by(body, c, f, rng) for c in body.mounts}) for f in range(FRAMES))
    waiting = np.cumsum([1 - len(estimator.update(frame)) for frame in frames])
    assert waiting.max() < 1.1 * 30 * (BLOCK_S + 2 * OVERLAP_S) and waiting.min() < 40


@pytest.mark.usefixtures("short_blocks")
def test_a_border_is_no_jump(body, cameras) -> None:
    """Blind from before the border until after it, where a block knows least of what follows."""

    def lost(camera: str, frame: int) -> bool:
        return camera == "wrist" and 25 <= frame < 80

    states = run(body, cameras, OFFLINE, lost=lost)
    wrist = body.segment_index["forearm"]
    steps = [
        states[f].world_T_segment[wrist, :3, :3].T @ states[f + 1].world_T_segment[wrist, :3, :3]
        for f in range(FRAMES - 1)
    ]
    true_steps = [
        true_poses(body, f)[wrist, :3, :3].T @ true_poses(body, f + 1)[wrist, :3, :3] for f in range(FRAMES - 1)
    ]
    errors = np.linalg.norm(log_so3(np.swapaxes(np.array(steps), -1, -2) @ np.array(true_steps)), axis=-1)
    assert errors[25:80].max() < 0.02


def test_a_blind_limb_is_held_from_both_sides(body, cameras, monkeypatch) -> None:
    def lost(camera: str, frame: int) -> bool:
        return camera == "wrist" and 30 <= frame < 90

    whole = run(body, cameras, OFFLINE, lost=lost)
    monkeypatch.setattr(solved_state_module, "_BLIND_WAIT_S", 0.0)
    forward = run(body, cameras, EstimatorSettings(), lost=lost)
    row, blind = body.segment_index["forearm"], range(30, 90)
    smoothed = turned_wrong(body, whole, row, blind)
    assert smoothed.mean() < turned_wrong(body, forward, row, blind).mean()
    assert smoothed.max() < np.radians(1.0)


def test_a_silence_is_bridged_between_smoothed_sides(body, cameras) -> None:
    states = run(body, cameras, OFFLINE, gone=lambda frame: 50 <= frame < 60)
    assert [frame for frame, state in states.items() if state.predicted] == list(range(50, 60))
    assert len(states) == FRAMES and position_errors(body, states).max() < 0.06


def test_a_long_pause_ends_one_recording_and_begins_another(body, cameras) -> None:
    states = run(body, cameras, OFFLINE, gone=lambda frame: 30 <= frame < 70)
    assert list(states) == [*range(30), *range(70, FRAMES)]
    assert position_errors(body, states).max() < 0.02


def test_says_how_far_it_is_and_can_be_interrupted(body, cameras) -> None:
    shares: list[float] = []
    run(body, cameras, OFFLINE, heard=shares.append)
    assert shares[0] == 0.0 and shares[-1] == 1.0 and shares == sorted(shares) and len(shares) > 3

    def stop(share: float) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run(body, cameras, OFFLINE, heard=stop)
