"""Least squares that outliers hardly move: a few unknowns, many measurements, Cauchy's loss."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from bodycam_ros.geometry import Array

Linearise = Callable[[Array], tuple[Array, Array]]
"""Unknowns (K,) -> residuals (N, D) and their derivatives (N, D, K)."""


@dataclass(frozen=True, eq=False)
class RobustFit:
    """What a fit found, linearised one step before the end.

    Attributes:
        values: (K,) unknowns.
        covariance: (K, K) by residuals of sigma 1 and the priors.
        residuals: (N, D) in sigmas.
        weights: (N,) of the measurements, 0 to 1.
    """

    values: Array
    covariance: Array
    residuals: Array
    weights: Array


def robust_least_squares(
    linearise: Linearise,
    start: Array,
    prior_sigmas: Array,
    kernel: float,
    rounds: int,
    converged: float = 0.0,
) -> RobustFit:
    """Minimise ``sum_n kernel^2 log(1 + |r_n|^2 / kernel^2) + sum_k (x_k / prior_sigma_k)^2``.

    Gauss-Newton on measurements that are weighted anew in each round (Holland and Welsch 1977, "Robust regression
    using iteratively reweighted least-squares"). It is not damped: for residuals that are linear, or start near.

    Args:
        linearise: unknowns (K,) -> residuals (N, D) in sigmas, of which the D of a measurement are weighted together,
            and their derivatives (N, D, K).
        start: (K,) the first unknowns.
        prior_sigmas: (K,) of the unknowns about 0; infinite where nothing is known of them.
        kernel: length of a residual at which its measurement counts half; infinite for ordinary least squares.
        rounds: at most, 1 or more.
        converged: no unknown changes by as much in the last round.

    Raises:
        numpy.linalg.LinAlgError: the measurements do not determine the unknowns.
    """
    x, prior = start, np.diag(np.asarray(prior_sigmas, np.float64) ** -2.0)
    for _ in range(rounds):
        r, J = linearise(x)
        weights = 1.0 / (1.0 + (r**2).sum(axis=1) / kernel**2)
        weighted = weights[:, None, None] * J
        information = np.tensordot(weighted, J, axes=([0, 1], [0, 1])) + prior
        step = -np.linalg.solve(information, np.tensordot(weighted, r, axes=([0, 1], [0, 1])) + prior @ x)
        x = x + step
        if np.abs(step).max(initial=0.0) < converged:
            break
    return RobustFit(x, np.asarray(np.linalg.inv(information), np.float64), r, weights)


def by_differences(residuals: Callable[[Array], Array], small: float) -> Linearise:
    """Residuals (N, D) with their derivatives by forward differences of a length, in the unknowns' own units."""

    def linearise(x: Array) -> tuple[Array, Array]:
        r = residuals(x)
        return r, np.stack([(residuals(x + step) - r) / small for step in small * np.eye(len(x))], axis=-1)

    return linearise
