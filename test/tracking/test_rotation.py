"""The rotation between frames (A eq. 2) against known rotations."""

import numpy as np
import pytest

from bodycam_ros.geometry import exp_so3, log_so3
from bodycam_ros.tracking.rotation import estimate_rotation


def random_bearings(count: int, seed: int) -> np.ndarray:
    """Unit vectors within 75 degrees of the optical axis, as a wide lens sees them."""
    rng = np.random.default_rng(seed)
    angle, turn = np.radians(75) * np.sqrt(rng.random(count)), 2 * np.pi * rng.random(count)
    return np.column_stack([np.sin(angle) * np.cos(turn), np.sin(angle) * np.sin(turn), np.cos(angle)])


def test_it_is_found_among_outliers_and_they_are_known() -> None:
    rng = np.random.default_rng(8)
    for seed in range(60):
        previous, turn = random_bearings(150, seed), exp_so3(rng.normal(0.0, 0.5, 3))
        current = previous @ turn.T
        wrong = rng.random(150) < rng.uniform(0.0, 0.6)
        current[wrong] = random_bearings(150, seed + 1000)[wrong]
        current += 2e-3 * rng.standard_normal(current.shape)
        current /= np.linalg.norm(current, axis=1, keepdims=True)
        estimated, inliers = estimate_rotation(previous, current, seed)
        assert np.degrees(np.linalg.norm(log_so3(estimated @ turn.T))) < 0.12
        assert (inliers == ~wrong).mean() > 0.98


@pytest.mark.parametrize("count", [0, 5, 100])
def test_there_is_none_where_too_few_agree(count: int) -> None:
    estimated, inliers = estimate_rotation(random_bearings(count, 1), random_bearings(count, 2), 0)
    np.testing.assert_array_equal(estimated, np.eye(3))
    assert inliers.shape == (count,) and not inliers.any()


def test_a_bearing_that_is_sampled_twice_does_no_harm() -> None:
    previous = np.repeat(random_bearings(20, 3)[:1], 20, axis=0)
    estimated, _ = estimate_rotation(previous, previous, 0)
    assert np.linalg.norm(previous @ estimated.T - previous, axis=1).max() < 1e-6
