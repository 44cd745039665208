"""The path of a camera between its images, against motions that are known everywhere."""

import numpy as np
import pytest

from bodycam_ros.geometry import exp_se3, exp_so3, inverse, log_se3, rigid
from bodycam_ros.timing.camera_path import CameraPath, nearest_rows

START = exp_se3(np.array([0.3, -0.5, 0.2, 1.0, 2.0, 0.5]))
TWIST = np.array([2.0, -1.0, 0.5, 0.4, -0.8, 0.3])


def ns(seconds: np.ndarray) -> np.ndarray:
    return np.round(1e9 * np.asarray(seconds)).astype(np.int64)


def gliding(seconds: np.ndarray) -> np.ndarray:
    return np.asarray(START @ exp_se3(np.asarray(seconds)[:, None] * TWIST))


def swinging(seconds: np.ndarray) -> np.ndarray:
    """A limb: 100 rad/s^2 and 4.4 m/s^2 at most."""
    phase = 2 * np.pi * 1.5 * np.asarray(seconds)[:, None]
    return rigid(exp_so3(1.126 * np.sin(phase) * np.array([0.0, 1.0, 0.0])), 0.05 * np.cos(phase) * np.ones(3))


def apart(a: np.ndarray, b: np.ndarray) -> tuple[float, float]:
    """Largest angle [rad] and distance [m] between poses."""
    step = log_se3(inverse(a) @ b)
    return float(np.linalg.norm(step[:, :3], axis=1).max()), float(np.linalg.norm(step[:, 3:], axis=1).max())


@pytest.mark.parametrize("times", [np.arange(8) / 24, np.array([0.0, 0.03, 0.1, 0.11, 0.19, 0.3])])
def test_a_constant_twist_is_followed_exactly_whatever_the_stamps(times: np.ndarray) -> None:
    path = CameraPath(ns(times), gliding(times))
    between = np.linspace(0.0, times[-1], 57)
    points = path.at(ns(between))
    assert max(apart(points.poses, gliding(between))) < 1e-7
    np.testing.assert_allclose(points.twists, np.broadcast_to(TWIST, points.twists.shape), atol=1e-6)


def test_at_its_images_the_path_is_what_they_say() -> None:
    times = np.arange(20) / 24
    points = CameraPath(ns(times), swinging(times)).at(ns(times))
    assert max(apart(points.poses, swinging(times))) < 1e-9
    assert np.array_equal(points.nearest, np.arange(20))


def test_a_swinging_limb_is_followed_far_better_than_by_a_straight_line() -> None:
    times = np.arange(0.0, 1.5, 1 / 24)
    path = CameraPath(ns(times), swinging(times))
    middles = times[1:-2] + 0.5 / 24
    points = path.at(ns(middles))
    angle, distance = apart(points.poses, swinging(middles))
    straight = path.world_T_camera[1:-2] @ exp_se3(
        0.5 * log_se3(inverse(path.world_T_camera[1:-2]) @ path.world_T_camera[2:-1])
    )
    straight_angle, _ = apart(straight, swinging(middles))
    assert np.degrees(angle) < 0.15 and distance < 1e-3
    assert angle < 0.15 * straight_angle
    # The twist there, from a step of a millisecond.
    ahead = log_se3(inverse(swinging(middles)) @ swinging(middles + 1e-3)) / 1e-3
    behind = log_se3(inverse(swinging(middles)) @ swinging(middles - 1e-3)) / -1e-3
    assert np.abs(points.twists - 0.5 * (ahead + behind))[:, :3].max() < 0.5


def test_a_single_image_stands_still() -> None:
    path = CameraPath(ns([1.0]), START[None])
    points = path.at(ns([1.0, 1.2]))
    assert np.array_equal(points.poses, np.stack([START, START]))
    assert not points.twists.any()
    assert path.inside(ns([0.9, 1.0, 1.1]), 1e9).tolist() == [False, True, False]


def test_gaps_and_what_lies_outside_are_not_inside() -> None:
    times = np.array([0.0, 0.1, 0.5, 0.6])
    path = CameraPath(ns(times), gliding(times))
    asked = np.array([-0.01, 0.0, 0.05, 0.1, 0.3, 0.5, 0.55, 0.6, 0.61])
    assert path.inside(ns(asked), 1e9 * 0.15).tolist() == [False, True, True, True, False, True, True, True, False]


def test_the_nearest_of_two_images_is_found() -> None:
    assert nearest_rows(ns([0.0, 1.0, 2.0]), ns([-1.0, 0.4, 0.6, 1.5, 9.0])).tolist() == [0, 0, 1, 1, 2]
    assert nearest_rows(ns([3.0]), ns([0.0, 5.0])).tolist() == [0, 0]
    times = np.arange(3) / 10
    points = CameraPath(ns(times), gliding(times)).at(ns([0.04, 0.06]))
    assert points.nearest.tolist() == [0, 1]
