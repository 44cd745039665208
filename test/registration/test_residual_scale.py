"""Weights that follow an image's own residuals, against noise of known size."""

import numpy as np
import pytest

from bodycam_ros.registration.residual_scale import residual_scale

SIGMA = 0.7


def errors(sigma_px: float, count: int, seed: int = 1) -> np.ndarray:
    """Lengths of reprojection errors whose axes are normal, of a fit that took nothing for itself."""
    return np.linalg.norm(np.random.default_rng(seed).normal(0.0, sigma_px, (count, 2)), axis=1)


@pytest.mark.parametrize("sigma_px", [1.0, 1.4, 2.1])
def test_larger_errors_are_measured(sigma_px: float) -> None:
    found = residual_scale(errors(sigma_px, 3000), np.ones(3000, bool), SIGMA)
    assert found == pytest.approx(sigma_px / SIGMA, rel=0.04)


def test_good_images_are_not_believed_more_than_was_set() -> None:
    assert residual_scale(errors(0.2, 100), np.ones(100, bool), SIGMA) == 1.0


def test_what_is_no_measurement_does_not_count() -> None:
    lengths = np.concatenate([errors(SIGMA, 500), np.full(300, 40.0), [np.inf]])
    assert residual_scale(lengths, lengths < 2.5, SIGMA) < 1.1


def test_too_few_say_nothing_and_no_image_is_worth_nothing() -> None:
    assert residual_scale(errors(3.0, 14), np.ones(14, bool), SIGMA) == 1.0
    assert residual_scale(errors(30.0, 100), np.ones(100, bool), SIGMA) == 4.0
