"""What a recording says of a joint that nothing sees for a while."""

import numpy as np
import pytest

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.joint import Joint
from bodycam_ros.geometry import exp_so3, log_so3
from bodycam_ros.solving.pose_memory import PoseMemory, PoseMemorySettings
from bodycam_ros.solving.recorded_poses import RecordedPoses

T, PERIOD_NS = 180, 33_333_333
STAMPS_NS = PERIOD_NS * np.arange(T, dtype=np.int64)
DARK = slice(60, 120)


@pytest.fixture(scope="module")
def body() -> BodyModel:
    joints = (
        Joint("left", "trunk", "arm_left", "ball", np.eye(4)),
        Joint("right", "trunk", "arm_right", "ball", np.eye(4)),
    )
    return BodyModel("swinging", "trunk", ("trunk", "arm_left", "arm_right"), joints, {})


def swinging(aside: float = 0.0) -> np.ndarray:
    """Joint rotations (T, 2, 3, 3): the right arm follows the left one by a quarter of a period."""
    phase = 2.0 * np.pi * 1e-9 * STAMPS_NS
    left, right = np.zeros((T, 3)), np.zeros((T, 3))
    left[:, 1], right[:, 1] = 0.5 * np.sin(phase), 0.4 * np.cos(phase)
    right[:, 0] = aside
    return np.stack([exp_so3(left), exp_so3(right)], axis=1)


def asked(body: BodyModel, rotations: np.ndarray, seen: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Errors (T,) [rad] of the right arm where it is dark: of the forward pass's memory, and of the recording."""
    memory = PoseMemory(body, PoseMemorySettings())
    for each, of_each in zip(rotations, seen, strict=True):
        memory.remember(each, of_each, 1e-9 * PERIOD_NS)
    again = memory.asked_again()
    expected = [
        again.expect(each, of_each, of_each, 1e-9 * PERIOD_NS) for each, of_each in zip(rotations, seen, strict=True)
    ]
    better = RecordedPoses(memory).expect(STAMPS_NS, rotations, seen, expected)
    dark = np.flatnonzero(~seen[:, 1])
    return tuple(
        np.array([np.linalg.norm(log_so3(told[k].rotations[0].T @ rotations[k, 1])) for k in dark])
        for told in (expected, better)
    )


def test_velocities_tell_the_phases_of_a_step_apart(body) -> None:
    seen = np.ones((T, 2), bool)
    seen[DARK, 1] = False
    before, better = asked(body, swinging(), seen)
    # Where the left arm is says nothing of the right one; how fast it swings says all.
    assert before.mean() > 0.2 and better.mean() < 0.03


def test_a_joint_stays_beside_where_it_is_told_to_be(body) -> None:
    """It swings beside its usual plane from before it was dark until after."""
    rotations = swinging()
    beside = swinging(aside=0.2)
    rotations[50:130, 1] = beside[50:130, 1]
    seen = np.ones((T, 2), bool)
    seen[DARK, 1] = False
    _, better = asked(body, rotations, seen)
    assert better[[0, -1]].max() < 0.02 and better[25:35].min() > 0.05


def test_what_was_seldom_seen_is_left_to_the_memory(body) -> None:
    seen = np.ones((T, 2), bool)
    seen[8:, 1] = False
    before, better = asked(body, swinging(), seen)
    np.testing.assert_array_equal(before, better)


def test_earlier_instants_are_remembered_for_a_while(body) -> None:
    rotations, seen = swinging(), np.ones((T, 2), bool)
    memory = PoseMemory(body, PoseMemorySettings(forget_after=10.0))
    poses = RecordedPoses(memory)
    nothing = memory.asked_again().expect(rotations[0], seen[0], seen[0], 0.03)
    poses.expect(STAMPS_NS, rotations, seen, [nothing] * T)
    poses.keep(T)
    hidden = seen.copy()
    hidden[:, 1] = False
    for later_s, known in ((6.0, True), (30.0, False)):
        stamps_ns = STAMPS_NS + int(1e9 * later_s)
        asking = memory.asked_again()
        expected = [asking.expect(each, of, of, 0.03) for each, of in zip(rotations, hidden, strict=True)]
        better = poses.expect(stamps_ns, rotations, hidden, expected)
        errors = [
            np.linalg.norm(log_so3(b.rotations[0].T @ r[1])) for b, r in zip(better[5:-5], rotations[5:-5], strict=True)
        ]
        assert (np.mean(errors) < 0.05) == known
        poses.keep(T)
