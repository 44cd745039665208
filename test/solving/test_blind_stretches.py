"""A limb that is blind for a while is averaged from both sides, and only where that is known."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from bodycam_ros.body.body_model import BodyModel, CameraMount
from bodycam_ros.body.joint import Joint
from bodycam_ros.geometry import exp_so3, log_so3, rigid
from bodycam_ros.solving.blind_stretches import BlindStretches
from bodycam_ros.solving.body_covariance import BodyUncertainty
from bodycam_ros.solving.body_state import BodyState

FRAME_NS = 33_333_333
FRAMES, BEGIN, END = 60, 10, 50
DRIFT = np.array([0.0, 0.0, 0.004])  # of a turn, each [rad]
UPPER_ARM, FOREARM = 1, 2
UNKNOWN = BodyUncertainty(np.eye(6), np.eye(6), np.tile(np.eye(3), (2, 1, 1)), np.tile(np.eye(6), (3, 1, 1)))


@pytest.fixture
def body() -> BodyModel:
    joints = (
        Joint("shoulder", "trunk", "upper_arm", "ball", rigid(np.eye(3), np.array([0.0, 0.2, 0.4]))),
        Joint("elbow", "upper_arm", "forearm", "ball", rigid(np.eye(3), np.array([0.0, 0.0, -0.3]))),
    )
    mounts = {"wrist": CameraMount("forearm", np.eye(4))}
    return BodyModel("test", "trunk", ("trunk", "upper_arm", "forearm"), joints, mounts)


def truth(body: BodyModel) -> np.ndarray:
    """Poses (T, S, 4, 4) of an arm that swings."""
    phase = np.linspace(0.0, 1.5, FRAMES)[:, None]
    shoulder, elbow = exp_so3(np.sin(phase) * [0.3, 0.8, 0.0]), exp_so3(np.cos(phase) * [0.0, 1.0, 0.2])
    return body.forward_kinematics(np.tile(np.eye(4), (FRAMES, 1, 1)), np.stack([shoulder, elbow], axis=1))


def states(
    body: BodyModel, blind: set[int], frames: range, without_turn: tuple[int, ...] = ()
) -> Iterator[tuple[BodyState, dict[int, np.ndarray]]]:
    """What a smoother has of it that goes forwards: blind segments turn by what was measured, which drifts."""
    poses = truth(body)
    R = poses[..., :3, :3].copy()
    for frame in range(FRAMES):
        unseen = blind if frame in frames else set[int]()
        turns = {}
        for row in blind if frame in frames or frame == frames.stop else ():
            if frame == 0 or frame in without_turn:
                continue
            turns[row] = poses[frame - 1, row, :3, :3].T @ poses[frame, row, :3, :3] @ exp_so3(DRIFT)
        for row in unseen:
            R[frame, row] = R[frame - 1, row] @ turns.get(row, np.eye(3)) if frame else exp_so3(np.array([0, 1.0, 0]))
        world_R = np.stack([np.eye(3), R[frame, 1], R[frame, 2]])
        guessed = body.forward_kinematics(np.eye(4), body.joint_rotations(rigid(world_R, np.zeros((3, 3)))))
        observed = np.array([row not in unseen for row in range(3)])
        yield BodyState((frame + 1) * FRAME_NS, body.segments, guessed, UNKNOWN, observed, 1), turns


def run(stretches: BlindStretches, said: Iterator[tuple[BodyState, dict[int, np.ndarray]]]) -> list[BodyState]:
    return [state for each in said for state in stretches.add(*each)] + stretches.flush()


def off(body: BodyModel, solved: list[BodyState], row: int) -> np.ndarray:
    """Angles (T) [rad] between a segment and the truth."""
    R = np.stack([state.world_T_segment[row, :3, :3] for state in solved])
    return np.linalg.norm(log_so3(np.swapaxes(truth(body)[:, row, :3, :3], 1, 2) @ R), axis=1)


def held(body: BodyModel, longest_s: float = 9.0) -> BlindStretches:
    return BlindStretches(body, longest_s, 0.01)


def test_a_blind_limb_is_averaged_from_both_sides(body) -> None:
    frames = range(BEGIN, END)
    forwards, both = (run(held(body, s), states(body, {FOREARM}, frames)) for s in (0.0, 9.0))
    assert [state.stamp_ns for state in both] == [state.stamp_ns for state in forwards]
    errors, drift = off(body, both, FOREARM), off(body, forwards, FOREARM)
    assert drift.max() > 30 * np.linalg.norm(DRIFT)
    # The way forwards and the way back drift to opposite sides, as far as the limb keeps its direction.
    assert errors.max() < 0.2 * drift.max()
    assert errors[:BEGIN].max() < 1e-6 and errors[END:].max() < 1e-6
    assert all(not state.observed[FOREARM] for state in both[BEGIN:END])


def test_a_limb_that_hangs_on_a_blind_one_hangs_on_where_it_is_put(body) -> None:
    solved = run(held(body), states(body, {UPPER_ARM, FOREARM}, range(BEGIN, END)))
    for row in (UPPER_ARM, FOREARM):
        assert off(body, solved, row).max() < 0.2 * 40 * np.linalg.norm(DRIFT)
    elbows = np.stack([state.world_T_segment[FOREARM, :3, 3] for state in solved])
    assert np.linalg.norm(elbows - truth(body)[:, FOREARM, :3, 3], axis=1).max() < 0.01


def test_what_a_seen_limb_below_tells_is_left_alone(body) -> None:
    forwards, both = (run(held(body, s), states(body, {UPPER_ARM}, range(BEGIN, END))) for s in (0.0, 9.0))
    for a, b in zip(forwards, both, strict=True):
        np.testing.assert_array_equal(a.world_T_segment, b.world_T_segment)


def test_what_a_loop_holds_is_left_alone(body) -> None:
    bar = Joint("bar", "trunk", "forearm", "ball", rigid(np.eye(3), np.array([0.3, 0.2, 0.1])))
    on_bar = BodyModel("test", "trunk", body.segments, (*body.joints, bar), body.mounts)
    forwards, both = (run(held(on_bar, s), states(body, {FOREARM}, range(BEGIN, END))) for s in (0.0, 9.0))
    for a, b in zip(forwards, both, strict=True):
        np.testing.assert_array_equal(a.world_T_segment, b.world_T_segment)


def test_after_a_black_picture_only_the_way_back_is_known(body) -> None:
    black = 30
    forwards, both = (run(held(body, s), states(body, {FOREARM}, range(BEGIN, END), (black,))) for s in (0.0, 9.0))
    before, after = off(body, forwards, FOREARM), off(body, both, FOREARM)
    np.testing.assert_allclose(after[:black], before[:black])
    assert after[black:END].max() < 1.1 * (END - black) * np.linalg.norm(DRIFT)


def test_a_limb_that_was_never_seen_before_goes_by_the_way_back(body) -> None:
    forwards, both = (run(held(body, s), states(body, {FOREARM}, range(0, END))) for s in (0.0, 9.0))
    assert off(body, forwards, FOREARM)[0] > 0.15
    assert off(body, both, FOREARM).max() < 1.1 * END * np.linalg.norm(DRIFT)


def test_nothing_waits_longer_than_it_may_and_nothing_at_all_where_all_is_seen(body) -> None:
    stretches, waiting = held(body, 0.5), []
    released = 0
    for frame, (state, turns) in enumerate(states(body, {FOREARM}, range(BEGIN, END))):
        released += len(stretches.add(state, turns))
        waiting.append(frame + 1 - released)
    assert max(waiting) == 16 and set(waiting[:BEGIN] + waiting[END:]) == {0}
    solved = run(held(body, 0.5), states(body, {FOREARM}, range(BEGIN, END)))
    steps = np.linalg.norm(np.diff(off(body, solved, FOREARM)))
    assert steps < 0.2 and len(solved) == FRAMES


def test_equipment_that_hangs_on_no_limb_stays_where_it_is(body) -> None:
    """The forearm is mended; a cart on a free joint of the forearm is no part of it, and its blind wheel no limb."""
    cart = Joint("cart", "forearm", "cart", "free", np.eye(4))
    wheel = Joint("wheel", "cart", "wheel", "hinge", np.eye(4))
    beside = BodyModel("test", "trunk", (*body.segments, "cart", "wheel"), (*body.joints, cart, wheel), body.mounts)
    stood = rigid(np.eye(3), np.array([2.0, 0.0, 0.0]))
    stretches = BlindStretches(beside, 9.0, 0.01)

    def with_cart(state: BodyState) -> BodyState:
        poses = np.concatenate([state.world_T_segment, [stood, stood]])
        return replace(
            state, segments=beside.segments, world_T_segment=poses, observed=np.append(state.observed, [True] * 2)
        )

    said = ((with_cart(state), turns) for state, turns in states(body, {FOREARM}, range(BEGIN, END)))
    solved = run(stretches, said)
    alone = run(held(body), states(body, {FOREARM}, range(BEGIN, END)))
    np.testing.assert_allclose(off(body, solved, FOREARM), off(body, alone, FOREARM), atol=1e-12)
    for state in solved:
        np.testing.assert_allclose(state.world_T_segment[3:], [stood, stood], atol=1e-12)
