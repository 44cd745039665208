"""Nonlinear least squares on any manifold: one damped Gauss-Newton loop."""

from collections.abc import Callable
from typing import TypeVar

import numpy as np

from bodycam_ros.geometry import Array

State = TypeVar("State")

_LEAST_DAMPING, _FIRST_DAMPING, _MOST_DAMPING = 1e-9, 1e-3, 1e6
_FLOOR = 1e-3  # of the mean of the diagonal: damps columns that no row moves


def damped_gauss_newton(
    start: State,
    linearise: Callable[[State], tuple[Array, Array, float]],
    moved: Callable[[State, Array], State],
    steps: int,
    longest_step: float,
    enough: float = 0.0,
    solved: float = 0.0,
) -> tuple[State, float]:
    """The state after so many steps that lower the cost, and its cost (Levenberg-Marquardt, Marquardt's scaling).

    Args:
        start: the first state.
        linearise: residuals (R), Jacobian (R, K) and cost of a state; weights of a robust cost are in the first two.
        moved: a state after an increment (K).
        steps: at most.
        longest_step: greatest component of an increment.
        enough: relative decrease of the cost at which it ends.
        solved: cost at which it ends, as it does where nothing can be moved (K = 0).
    """
    state, damping = start, _FIRST_DAMPING
    residuals, J, cost = linearise(state)
    for _ in range(steps):
        hessian, gradient, before = J.T @ J, J.T @ residuals, cost
        if cost <= solved or not len(gradient):
            break
        scale = np.diag(hessian) + _FLOOR * np.trace(hessian) / len(hessian)
        while damping < _MOST_DAMPING:
            step = -np.linalg.solve(hessian + np.diag(damping * scale), gradient)
            shortening = min(1.0, longest_step / max(float(np.abs(step).max()), 1e-12))
            tried = moved(state, np.asarray(shortening * step, np.float64))
            system = linearise(tried)
            if system[2] < cost:
                state, (residuals, J, cost) = tried, system
                damping = max(0.2 * damping, _LEAST_DAMPING)
                break
            damping *= 5.0
        if before - cost <= enough * before:
            break
        damping = min(damping, 0.1 * _MOST_DAMPING)
    return state, cost
