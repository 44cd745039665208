"""Instants of a file between those that were solved."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.known_walk import FRAME_NS, Walk, write_solved
from helpers.recorded_progress import Unshown
from scipy.spatial.transform import Rotation, Slerp

from bodycam_ros.formats.sampled_motion import SampledMotion, sample_motion
from bodycam_ros.kinematics.joint_angles import JointAngles
from bodycam_ros.results.solved_body import SolvedBody, read_solved_body

RATE = 97.0


@pytest.fixture(scope="module")
def solved(walk: Walk, tmp_path_factory: pytest.TempPathFactory) -> SolvedBody:
    return read_solved_body(write_solved(walk, tmp_path_factory.mktemp("sampled") / "out"), Unshown())


@pytest.fixture(scope="module")
def gappy(walk: Walk, tmp_path_factory: pytest.TempPathFactory) -> SolvedBody:
    """Instants 20 to 29 were not solved."""
    return read_solved_body(
        write_solved(walk.without(list(range(20, 30))), tmp_path_factory.mktemp("gappy") / "out"), Unshown()
    )


def turns(motion: SampledMotion) -> np.ndarray:
    """(T, J, 3, 3) rotations of the joints."""
    return JointAngles(motion.body).rotations(motion.joint_angles)


def test_joints_turn_as_scipy_interpolates_rotations(solved: SolvedBody) -> None:
    motion, own = sample_motion(solved, RATE, even=True), sample_motion(solved, None, even=False)
    assert motion.rate == RATE and len(motion.stamps_ns) > 150
    times = own.seconds
    for row in range(turns(own).shape[1]):
        between = Slerp(times, Rotation.from_matrix(turns(own)[:, row]))(motion.seconds).as_matrix()
        np.testing.assert_allclose(turns(motion)[:, row], between, atol=1e-7)
    between = Slerp(times, Rotation.from_matrix(own.world_T_root[:, :3, :3]))(motion.seconds).as_matrix()
    np.testing.assert_allclose(motion.world_T_root[:, :3, :3], between, atol=1e-7)
    straight = np.column_stack([np.interp(motion.seconds, times, place) for place in own.world_T_root[:, :3, 3].T])
    np.testing.assert_allclose(motion.world_T_root[:, :3, 3], straight, atol=1e-7)


def bone_lengths(motion: SampledMotion) -> np.ndarray:
    knee, ankle = motion.segment_poses("shin_left")[:, :3, 3], motion.segment_poses("foot_left")[:, :3, 3]
    return np.linalg.norm(ankle - knee, axis=1)


@pytest.mark.parametrize("rate", [7.3, 30.0, RATE, 240.0])
def test_nothing_is_extrapolated_and_bones_keep_their_length(solved: SolvedBody, rate: float) -> None:
    motion = sample_motion(solved, rate, even=True)
    first, last = solved.stamps_ns[[0, -1]]
    assert motion.stamps_ns[0] == first and last - 1e9 / rate < motion.stamps_ns[-1] <= last
    assert motion.known.all()
    np.testing.assert_allclose(np.diff(motion.stamps_ns), 1e9 / rate, atol=2000.0)
    np.testing.assert_allclose(bone_lengths(motion), 0.4, atol=1e-9)


def test_instants_that_were_solved_are_as_they_were(solved: SolvedBody) -> None:
    """The recording's own rate, and one of which every second instant is solved."""
    for rate, every in ((None, 1), (2e9 / FRAME_NS, 2)):
        motion = sample_motion(solved, rate, even=True)
        assert len(motion.stamps_ns[::every]) == len(solved.stamps_ns)
        np.testing.assert_array_equal(motion.stamps_ns[::every], solved.stamps_ns)
        np.testing.assert_allclose(motion.joint_angles[::every], solved.joint_angles, atol=1e-9)


def test_angles_stay_near_those_that_were_solved(solved: SolvedBody) -> None:
    """A turn more is the same rotation; angles in between belong to the turn that was published."""
    angles = solved.joint_angles.copy()
    angles[:, 1] += 4.0 * np.pi
    turned = replace(solved, joint_angles=angles)
    motion, unturned = sample_motion(turned, RATE, even=True), sample_motion(solved, RATE, even=True)
    np.testing.assert_allclose(motion.joint_angles[:, 1], unturned.joint_angles[:, 1] + 4.0 * np.pi, atol=1e-6)
    np.testing.assert_allclose(motion.world_T_segment, unturned.world_T_segment, atol=1e-9)


def test_a_gap_is_told_and_is_not_known(gappy: SolvedBody, caplog: pytest.LogCaptureFixture) -> None:
    even = sample_motion(gappy, None, even=True)
    assert "1 gap without solved frames, 0.37 s in total, the longest of 0.37 s at 0.63 s" in caplog.text
    assert len(even.stamps_ns) == 60
    np.testing.assert_array_equal(np.flatnonzero(~even.known), np.arange(20, 30))
    assert np.isfinite(even.world_T_segment).all()
    as_solved = sample_motion(gappy, None, even=False)
    assert len(as_solved.stamps_ns) == 50 and as_solved.known.all()
