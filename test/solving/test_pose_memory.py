"""What the poses that were seen say of a limb that is not: expectation, spread, limits."""

import numpy as np
import pytest

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.joint import Joint
from bodycam_ros.geometry import exp_so3, log_so3, rigid
from bodycam_ros.solving.pose_memory import PoseMemory, PoseMemorySettings

DT_S = 1 / 30
LIMITS = ((-1.0, 1.2), (-0.5, 0.5), (-0.5, 0.5))
NOBODY = np.zeros(2, bool)


@pytest.fixture
def walker() -> BodyModel:
    """Hips on either side of a pelvis."""
    joints = tuple(
        Joint(
            f"hip_{side}", "pelvis", f"thigh_{side}", "ball", rigid(np.eye(3), np.array([0.0, y, 0.0])), limits=LIMITS
        )
        for side, y in (("left", 0.1), ("right", -0.1))
    )
    return BodyModel("walker", "pelvis", ("pelvis", "thigh_left", "thigh_right"), joints, {})


def stride(phase: float) -> np.ndarray:
    """(2, 3, 3) hips that swing against each other about y."""
    return exp_so3(np.array([[0.0, 0.6 * np.sin(phase), 0.0], [0.0, -0.6 * np.sin(phase) + 0.1, 0.0]]))


def taught(walker: BodyModel, seconds: float) -> PoseMemory:
    memory = PoseMemory(walker, PoseMemorySettings())
    for frame in range(round(seconds / DT_S)):
        memory.remember(stride(6.0 * frame * DT_S), np.array([True, True]), DT_S)
    return memory


def expected_angle(memory: PoseMemory, phase: float) -> tuple[float, float]:
    """Angle about y [rad] and sigma that the memory expects of the left hip when the right one is seen."""
    expected = memory.expect(stride(phase), np.array([False, True]), NOBODY, DT_S)
    assert list(expected.rows) == [0]
    return float(log_so3(expected.rotations)[0, 1]), float(expected.sigmas[0].max())


def test_a_hip_that_is_not_seen_swings_against_the_one_that_is(walker) -> None:
    memory = taught(walker, 6.0)
    for phase in np.linspace(0.0, 6.0, 13):
        assert expected_angle(memory, phase)[0] == pytest.approx(0.6 * np.sin(phase), abs=0.06)


def test_without_memory_the_limb_hangs_in_the_n_pose_and_may_be_anywhere(walker) -> None:
    angle, before = expected_angle(PoseMemory(walker, PoseMemorySettings()), 1.0)
    assert angle == pytest.approx(0.0, abs=1e-9)
    assert before > 2 * expected_angle(taught(walker, 6.0), 1.0)[1]


def test_a_blink_is_left_to_the_limbs_own_motion(walker) -> None:
    memory = taught(walker, 6.0)
    sigmas = [expected_angle(memory, 1.0)[1] for _ in range(30)]
    assert sigmas[0] > 2 * sigmas[-1]
    lead = memory.expect(stride(1.0), np.array([False, True]), NOBODY, DT_S).lead
    assert lead[0] == 1.0
    memory.expect(stride(1.0), np.array([True, True]), NOBODY, DT_S)
    assert memory.expect(stride(1.0), np.array([False, True]), NOBODY, DT_S).lead[0] < 0.3


def test_a_limb_whose_rotation_is_measured_is_hardly_drawn(walker) -> None:
    memory = taught(walker, 6.0)
    turning = memory.expect(stride(1.0), np.array([False, True]), np.array([True, False]), DT_S)
    blind = taught(walker, 6.0).expect(stride(1.0), np.array([False, True]), NOBODY, DT_S)
    assert turning.sigmas[0].max() > 5 * blind.sigmas[0].max()
    assert turning.lead[0] == 0.0


def test_the_steps_are_those_of_the_expectation(walker) -> None:
    memory = taught(walker, 6.0)
    first = memory.expect(stride(1.0), np.array([False, True]), NOBODY, DT_S)
    assert np.allclose(first.steps, np.eye(3))
    second = memory.expect(stride(1.2), np.array([False, True]), NOBODY, DT_S)
    assert np.allclose(first.rotations @ second.steps, second.rotations)


def test_no_joint_turns_farther_than_its_limits_or_than_it_has_been_seen(walker) -> None:
    memory = PoseMemory(walker, PoseMemorySettings())
    far = exp_so3(np.array([[0.0, 2.0, 0.0], [0.0, 0.3, 0.0]]))
    assert log_so3(memory.within_limits(far))[:, 1] == pytest.approx([1.2, 0.3])
    memory.remember(exp_so3(np.array([[0.0, 1.6, 0.0], [0.0, 0.3, 0.0]])), np.array([True, True]), DT_S)
    assert log_so3(memory.within_limits(far))[:, 1] == pytest.approx([1.6, 0.3])


def test_a_pose_unlike_all_others_throws_nothing_beyond_what_was_seen(walker) -> None:
    memory = taught(walker, 6.0)
    wild = exp_so3(np.array([[0.0, 0.0, 0.0], [0.0, -1.0, 0.4]]))
    expected = memory.expect(wild, np.array([False, True]), NOBODY, DT_S)
    assert np.linalg.norm(log_so3(expected.rotations)) < 1.2


def test_a_machine_beside_the_body_is_expected_by_its_rotation_alone(walker) -> None:
    """A free joint has a place beside its three angles; the memory knows rotations only, and must not mix them up."""
    board = Joint("board", "pelvis", "board", "free", np.eye(4))
    skater = BodyModel("skater", "pelvis", (*walker.segments, "board"), (board, *walker.joints), {})
    memory = PoseMemory(skater, PoseMemorySettings())
    for frame in range(200):
        memory.remember(np.concatenate([np.eye(3)[None], stride(6.0 * frame * DT_S)]), np.ones(3, bool), DT_S)
    rotations = np.concatenate([exp_so3(np.array([[0.0, 0.0, 3.0]])), stride(0.5)])
    expected = memory.expect(rotations, np.array([True, False, True]), np.zeros(3, bool), DT_S)
    assert list(expected.rows) == [1]
    assert log_so3(expected.rotations)[0, 1] == pytest.approx(0.6 * np.sin(0.5), abs=0.06)
    beyond = exp_so3(np.array([[0.0, 0.0, 3.0], [0.0, 2.0, 0.0], [0.0, 0.0, 0.0]]))
    kept = log_so3(memory.within_limits(beyond))
    np.testing.assert_allclose(kept, [[0.0, 0.0, 3.0], [0.0, 1.2, 0.0], [0.0, 0.0, 0.0]], atol=1e-9)
