"""The rotation between frames (A eq. 2) against known rotations."""

import numpy as np
from numpy_rotation import estimate_rotation_in_numpy

from bodycam_ros.geometry import exp_so3
from bodycam_ros.tracking.rotation import estimate_rotation


def random_bearings(count: int, seed: int) -> np.ndarray:
    """Unit vectors within 75 degrees of the optical axis, as a wide lens sees them."""
    rng = np.random.default_rng(seed)
    angle, turn = np.radians(75) * np.sqrt(rng.random(count)), 2 * np.pi * rng.random(count)
    return np.column_stack([np.sin(angle) * np.cos(turn), np.sin(angle) * np.sin(turn), np.cos(angle)])


def test_it_is_that_of_numpy_whatever_the_share_of_outliers() -> None:
    rng = np.random.default_rng(8)
    found = 0
    for seed in range(60):
        count = int(rng.integers(1, 150))
        previous = random_bearings(count, seed)
        current = previous @ exp_so3(rng.normal(0.0, 0.5, 3)).T
        wrong = rng.random(count) < rng.uniform(0.0, 0.9)
        current[wrong] = random_bearings(count, seed + 1000)[wrong]
        current += 2e-3 * rng.standard_normal(current.shape)
        current /= np.linalg.norm(current, axis=1, keepdims=True)
        estimated, inliers = estimate_rotation(previous, current, seed)
        expected, agreeing = estimate_rotation_in_numpy(previous, current, seed)
        np.testing.assert_allclose(estimated, expected, atol=1e-13)
        np.testing.assert_array_equal(inliers, agreeing)
        found += inliers.any()
    assert 20 < found < 60
