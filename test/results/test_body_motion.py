"""Trajectories between their stamps, on motions that are known at every time."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

from bodycam_ros.geometry import Array, exp_so3, rigid
from bodycam_ros.results.body_motion import (
    between_neighbours,
    distance_in_time,
    interpolated,
    nearest,
    nearest_rows,
    pose_near,
)

STAMPS_NS = np.array([0, 10, 20, 40, 100], np.int64) * 1_000_000


def screw(stamps_ns: Array) -> Array:
    """A motion at constant speed and angular velocity (..., 4, 4)."""
    seconds = 1e-9 * np.asarray(stamps_ns, np.float64)[..., None]
    return rigid(exp_so3(seconds * [3.0, -8.0, 5.0]), seconds * [1.0, 2.0, -3.0] + [0.5, 0.0, 1.0])


def test_a_motion_at_constant_speed_is_exact_between_its_stamps() -> None:
    at_ns = np.linspace(STAMPS_NS[0], STAMPS_NS[-1], 57).astype(np.int64)
    np.testing.assert_allclose(interpolated(STAMPS_NS, screw(STAMPS_NS), at_ns), screw(at_ns), atol=1e-12)


def test_rotations_are_those_of_scipys_slerp() -> None:
    random = np.random.default_rng(1)
    poses = rigid(exp_so3(random.normal(size=(len(STAMPS_NS), 3))), random.normal(size=(len(STAMPS_NS), 3)))
    at_ns = random.integers(STAMPS_NS[0], STAMPS_NS[-1], 40)
    slerp = Slerp(STAMPS_NS.astype(float), Rotation.from_matrix(poses[:, :3, :3]))
    found = interpolated(STAMPS_NS, poses, at_ns)
    np.testing.assert_allclose(found[:, :3, :3], slerp(at_ns.astype(float)).as_matrix(), atol=1e-9)
    for axis in range(3):
        straight = np.interp(at_ns, STAMPS_NS, poses[:, axis, 3])
        np.testing.assert_allclose(found[:, axis, 3], straight, atol=1e-12)


def test_at_its_own_stamps_a_trajectory_is_itself() -> None:
    poses = screw(STAMPS_NS)
    np.testing.assert_allclose(interpolated(STAMPS_NS, poses, STAMPS_NS), poses, atol=1e-12)


@pytest.mark.parametrize(("at_ns", "row"), [(-5, 0), (0, 0), (100_000_000, -1), (10**12, -1)])
def test_beyond_its_ends_a_pose_is_that_of_the_end(at_ns: int, row: int) -> None:
    poses = screw(STAMPS_NS)
    np.testing.assert_allclose(pose_near(STAMPS_NS, poses, at_ns), poses[row], atol=1e-12)
    np.testing.assert_array_equal(pose_near(STAMPS_NS[:1], poses[:1], at_ns), poses[0])


def test_a_time_in_a_gap_or_outside_is_not_between_neighbours() -> None:
    at_ns = np.array([-1, 0, 5, 20, 30, 40, 41, 99, 100, 101]) * 1_000_000
    between = between_neighbours(STAMPS_NS, at_ns, 20e6)
    assert between.tolist() == [False, True, True, True, True, False, False, False, False, False]
    # A stamp itself belongs to the step that follows, the last one to the step before.
    assert between_neighbours(STAMPS_NS, at_ns, 60e6).tolist() == [False, *[True] * 8, False]
    assert not between_neighbours(STAMPS_NS[:1], at_ns, 1e9).any()


def test_the_nearest_stamp_is_found_within_a_distance() -> None:
    assert nearest(STAMPS_NS, 14_000_000, 4_000_000) == 1
    assert nearest(STAMPS_NS, 14_000_000, 3_999_999) is None
    assert nearest(STAMPS_NS, -7, 7) == 0
    assert nearest(STAMPS_NS[:0], 0, 10**18) is None


def test_nearest_rows_are_those_of_a_search_through_all() -> None:
    at_ns = np.random.default_rng(2).integers(-50_000_000, 150_000_000, 200)
    expected = np.abs(STAMPS_NS - at_ns[:, None]).min(axis=1)
    np.testing.assert_array_equal(np.abs(STAMPS_NS[nearest_rows(STAMPS_NS, at_ns)] - at_ns), expected)
    np.testing.assert_array_equal(distance_in_time(at_ns, STAMPS_NS), expected)
    assert (distance_in_time(at_ns, STAMPS_NS[:0]) == np.iinfo(np.int64).max).all()
    np.testing.assert_array_equal(distance_in_time(at_ns, STAMPS_NS[:1]), np.abs(at_ns - STAMPS_NS[0]))
