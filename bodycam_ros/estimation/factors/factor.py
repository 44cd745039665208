"""Factors as gtsam takes them: errors in sigmas and their Jacobians by the vectors of one or two states.

All factors of the same variables are one ``gtsam.CustomFactor``: gtsam calls Python once for them, and stacked rows are
the same least squares.
"""

from collections.abc import Sequence
from typing import Protocol

import gtsam
import numpy as np

from bodycam_ros.estimation.coordinates import Chart, Coordinates
from bodycam_ros.geometry import Array


class StateFactor(Protocol):
    """A measurement of one state, in M rows."""

    @property
    def rows(self) -> int:
        """M."""

    def error(self, at: Coordinates) -> Array:
        """(M,) whose half sum of squares is the loss."""

    def linearise(self, at: Coordinates) -> tuple[Array, Array]:
        """Errors (M,) and their Jacobian (M, K) by an increment of the coordinates, both by the robust weights."""


class StepFactor(Protocol):
    """A measurement of two states, in M rows."""

    @property
    def rows(self) -> int:
        """M."""

    def linearise(self, before: Coordinates, after: Coordinates) -> tuple[Array, Array, Array]:
        """Errors (M,) and their Jacobians (M, 2K) by velocities and increments of the earlier and the later state."""


def state_key(number: int) -> int:
    """The key of a state."""
    key: int = gtsam.symbol("x", number)
    return key


def on_state(
    key: int, chart: Chart, factors: Sequence[StateFactor], with_velocity: bool = True
) -> gtsam.NonlinearFactor:
    """All measurements of one state, whose variable has velocities or the increment of the coordinates alone."""
    rows, first = sum(factor.rows for factor in factors), chart.size if with_velocity else 0

    def evaluate(this: gtsam.CustomFactor, values: gtsam.Values, H: list[Array] | None) -> Array:
        x = values.atVector(key)
        at = chart.at(x)
        if H is None:
            return np.concatenate([factor.error(at) for factor in factors])
        errors = np.empty(rows)
        jacobian = np.zeros((rows, first + chart.size), order="F")
        end = 0
        for factor in factors:
            part = slice(end, end := end + factor.rows)
            errors[part], by_step = factor.linearise(at)
            jacobian[part, first:] = chart.by_vector(by_step, x)
        H[0] = jacobian
        return errors

    return gtsam.CustomFactor(gtsam.noiseModel.Unit.Create(rows), [key], evaluate)


def on_step(keys: tuple[int, int], charts: tuple[Chart, Chart], factor: StepFactor) -> gtsam.NonlinearFactor:
    """A measurement of two states."""
    K = charts[0].size

    def evaluate(this: gtsam.CustomFactor, values: gtsam.Values, H: list[Array] | None) -> Array:
        vectors = [values.atVector(key) for key in keys]
        errors, *jacobians = factor.linearise(*(chart.at(x) for chart, x in zip(charts, vectors, strict=True)))
        if H is not None:
            for number, (chart, x, jacobian) in enumerate(zip(charts, vectors, jacobians, strict=True)):
                jacobian[:, K:] = chart.by_vector(jacobian[:, K:], x)
                H[number] = jacobian
        return errors

    return gtsam.CustomFactor(gtsam.noiseModel.Unit.Create(factor.rows), list(keys), evaluate)
