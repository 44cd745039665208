"""Robust least squares against SciPy's, with outliers, priors and measurements of several residuals."""

import numpy as np
import pytest
from scipy.optimize import least_squares

from bodycam_ros.robust_least_squares import by_differences, robust_least_squares

Array = np.ndarray
SECONDS = np.linspace(0.0, 3.0, 60)
TRUE = np.array([1.5, -0.8, 0.4])
SIGMA, KERNEL = 0.02, 2.5
NO_PRIOR = np.full(3, np.inf)


def curve(x: Array) -> Array:
    """(N, 2) points of a decaying turn: amplitude, decay and phase."""
    angle = 2.0 * SECONDS + x[2]
    return x[0] * np.exp(x[1] * SECONDS)[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])


def measured(outliers: int, seed: int = 4) -> Array:
    rng = np.random.default_rng(seed)
    points = curve(TRUE) + rng.normal(0.0, SIGMA, (len(SECONDS), 2))
    points[rng.choice(len(SECONDS), outliers, replace=False)] += rng.uniform(0.5, 2.0, (outliers, 2))
    return points


def residuals_of(points: Array):  # noqa: ANN201
    return lambda x: (curve(x) - points) / SIGMA


def loss(squared: Array, linear: int) -> Array:
    """Cauchy's for SciPy, with its derivatives; none for the last few residuals."""
    rho = np.stack([np.log1p(squared), 1.0 / (1.0 + squared), -1.0 / (1.0 + squared) ** 2])
    if linear:
        rho[:, -linear:] = squared[-linear:], np.ones(linear), np.zeros(linear)
    return rho


@pytest.mark.parametrize("sigma", [np.inf, 0.05])
@pytest.mark.parametrize("outliers", [0, 18])
def test_minimises_what_scipy_minimises(outliers: int, sigma: float) -> None:
    residuals, start = residuals_of(measured(outliers)), TRUE + [0.1, 0.1, -0.1]
    prior = np.array([sigma, np.inf, np.inf])
    fit = robust_least_squares(by_differences(residuals, 1e-7), start, prior, KERNEL, 200, 1e-12)

    def scipys(x: Array) -> Array:
        # The loss is of a measurement's length, and the prior's residual has none: SciPy scales all by the kernel.
        lengths = np.linalg.norm(residuals(x), axis=1)
        return np.append(lengths, [x[0] / sigma] if np.isfinite(sigma) else [])

    linear = int(np.isfinite(sigma))
    expected = least_squares(
        scipys, start, loss=lambda z: loss(z, linear), f_scale=KERNEL, xtol=1e-15, ftol=1e-15, gtol=1e-15
    )
    np.testing.assert_allclose(fit.values, expected.x, atol=1e-7)


def test_outliers_hardly_move_it_and_weigh_little() -> None:
    points, start = measured(18), TRUE + [0.1, 0.1, -0.1]
    linearise = by_differences(residuals_of(points), 1e-7)
    robust = robust_least_squares(linearise, start, NO_PRIOR, KERNEL, 100, 1e-10)
    plain = robust_least_squares(linearise, start, NO_PRIOR, np.inf, 100, 1e-10)
    assert np.abs(robust.values - TRUE).max() < 0.02 < np.abs(plain.values - TRUE).max()
    far = np.linalg.norm(points - curve(TRUE), axis=1) > 0.4
    assert far.sum() == 18 and robust.weights[far].max() < 0.02 < 0.1 < robust.weights[~far].min()
    np.testing.assert_array_equal(plain.weights, 1.0)


def test_linear_residuals_without_outliers_take_one_round_and_have_the_textbook_covariance() -> None:
    rng = np.random.default_rng(2)
    A, b = rng.normal(size=(40, 3)), rng.normal(size=40)
    fit = robust_least_squares(lambda x: ((A @ x - b)[:, None], A[:, None]), np.zeros(3), NO_PRIOR, np.inf, 1)
    np.testing.assert_allclose(fit.values, np.linalg.lstsq(A, b, rcond=None)[0], atol=1e-12)
    np.testing.assert_allclose(fit.covariance, np.linalg.inv(A.T @ A), atol=1e-12)


def test_the_covariance_is_that_of_repeated_measurements() -> None:
    start = TRUE + [0.05, 0.05, -0.05]
    fits = [
        robust_least_squares(by_differences(residuals_of(measured(0, seed)), 1e-7), start, NO_PRIOR, 1e3, 50, 1e-10)
        for seed in range(300)
    ]
    found = np.cov(np.array([fit.values for fit in fits]).T)
    np.testing.assert_allclose(np.sqrt(np.diag(found)), np.sqrt(np.diag(fits[0].covariance)), rtol=0.15)


def test_unknowns_that_nothing_determines_are_refused_without_a_prior_and_0_with_one() -> None:
    def linearise(x: Array) -> tuple[Array, Array]:
        return np.array([[x[0] - 1.0]]), np.array([[[1.0, 0.0]]])

    with pytest.raises(np.linalg.LinAlgError):
        robust_least_squares(linearise, np.zeros(2), np.full(2, np.inf), np.inf, 1)
    fit = robust_least_squares(linearise, np.ones(2), np.array([np.inf, 0.1]), np.inf, 1)
    np.testing.assert_allclose(fit.values, [1.0, 0.0], atol=1e-12)
