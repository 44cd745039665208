"""The newest state before it enters the window: predicted by what precedes it, fitted to what was measured of it."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import gtsam
import numpy as np

from bodycam_ros.estimation.coordinates import LINEAR, SETTLED, STEPS, Chart, Coordinates
from bodycam_ros.estimation.factors.factor import StateFactor, on_state
from bodycam_ros.geometry import Array

_BEFORE, _NOW = 0, 1  # keys of the small graphs here
_ITERATIONS = 2  # at most, of measurements between states


@dataclass(frozen=True, eq=False)
class Prediction:
    """A state given all before it, and what was measured between.

    Attributes:
        before: the state before, given the same.
        at: the predicted coordinates.
        square_root: (2K, 2K) upper triangular square root of the information about these, velocities first.
        dt_s: between the two [s]; 0 at a first state.
    """

    before: Coordinates
    at: Coordinates
    square_root: Array
    dt_s: float

    @property
    def of_coordinates(self) -> Array:
        """(K, K) square root of the information of the coordinates, whatever the velocities are."""
        K = self.at.tangent.count
        return np.ascontiguousarray(self.square_root[K:, K:])

    @cached_property
    def information(self) -> Array:
        """(K, K) information of the coordinates."""
        return np.asarray(self.of_coordinates.T @ self.of_coordinates, np.float64)

    def factor(self, key: int, chart: Chart) -> gtsam.NonlinearFactor:
        """All that it has, as a factor of the state alone."""
        point, unit = gtsam.Values(), gtsam.noiseModel.Unit.Create(len(self.square_root))
        point.insert(key, chart.vector(self.at))
        linear = gtsam.JacobianFactor(key, self.square_root, np.zeros(len(self.square_root)), unit)
        return gtsam.LinearContainerFactor(linear, point)

    @staticmethod
    def first(initial: Coordinates, sigmas: Array) -> "Prediction":
        """A state that follows from none, with sigmas (2K) of its velocities and coordinates."""
        return Prediction(initial, initial, np.diag(1.0 / sigmas), 0.0)


def predict_state(
    before: Chart, x_before: Array, root_before: Array, now: Chart, factors: gtsam.NonlinearFactorGraph, dt_s: float
) -> Prediction:
    """Predict a state from the one before.

    Args:
        before, now: charts of both, with keys 0 and 1.
        x_before: (2K) estimate of the state before.
        root_before: (2K, 2K) square root of its information.
        factors: between both, and of the later one.
        dt_s: between them [s].
    """
    unit, order = gtsam.noiseModel.Unit.Create(len(x_before)), gtsam.Ordering()
    order.push_back(_BEFORE)
    order.push_back(_NOW)
    values = gtsam.Values()
    values.insert(_BEFORE, x_before)
    values.insert(_NOW, np.zeros(len(x_before)))
    # It is repeated about its outcome: a limb that is observed again may be far from its prediction.
    for _ in range(_ITERATIONS):
        linear = factors.linearize(values)
        linear.add(
            gtsam.JacobianFactor(_BEFORE, root_before, root_before @ (x_before - values.atVector(_BEFORE)), unit)
        )
        solution = linear.eliminateSequential(order)
        step = solution.optimize()
        values = values.retract(step)
        if max(np.abs(step.at(key)[before.size :]).max() for key in (_BEFORE, _NOW)) < SETTLED:
            break
    ends = [chart.at(values.atVector(key)) for key, chart in ((_BEFORE, before), (_NOW, now))]
    predicted = solution.at(1)  # its matrix is a view of its memory
    return Prediction(ends[0], ends[1], np.array(predicted.R()), dt_s)


@dataclass(frozen=True, eq=False)
class Fit:
    """The coordinates that fit a prediction and measurements, and whether the iterations converged."""

    at: Coordinates
    converged: bool


def fit_state(prediction: Prediction, stages: Sequence[Sequence[StateFactor]], starts: Sequence[Coordinates]) -> Fit:
    """Levenberg-Marquardt on the coordinates of one state, with Cauchy's loss (A 4.3).

    Args:
        prediction: of the state.
        stages: its measurements; of several lists each starts where the one before ended.
        starts: initial coordinates; those that fit best are used.
    """
    chart, unit = Chart(prediction.at), gtsam.noiseModel.Unit.Create(len(prediction.of_coordinates))
    origin, zero = gtsam.Values(), np.zeros(chart.size)
    origin.insert(_NOW, zero)
    predicted = gtsam.LinearContainerFactor(gtsam.JacobianFactor(_NOW, prediction.of_coordinates, zero, unit), origin)
    vectors, converged = [prediction.at.step_to(start) for start in starts], False
    for factors in stages:
        graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
        graph.add(predicted)
        if factors:
            graph.add(on_state(_NOW, chart, factors, with_velocity=False))
        x = min(vectors, key=lambda each: _error(graph, each)) if len(vectors) > 1 else vectors[0]
        values.insert(_NOW, x)
        optimizer = gtsam.LevenbergMarquardtOptimizer(graph, values, _PARAMETERS)
        settled = SETTLED if factors is stages[-1] else LINEAR
        for _ in range(STEPS):
            optimizer.iterate()
            before, x = x, optimizer.values().atVector(_NOW)
            if converged := bool(np.abs(x - before).max() < settled):
                break
        vectors = [x]
    return Fit(chart.at(x), converged)


def _error(graph: gtsam.NonlinearFactorGraph, x: Array) -> float:
    values = gtsam.Values()
    values.insert(_NOW, x)
    return float(graph.error(values))


def _parameters() -> gtsam.LevenbergMarquardtParams:
    parameters = gtsam.LevenbergMarquardtParams()
    parameters.setLinearSolverType("SEQUENTIAL_CHOLESKY")
    order = gtsam.Ordering()
    order.push_back(_NOW)
    parameters.setOrdering(order)
    return parameters


_PARAMETERS = _parameters()


def solve_normal_equations(matrix: Array, right_side: Array) -> tuple[Array, Array]:
    """Solution (K,) and covariance (K, K) of normal equations with a positive definite matrix, by gtsam."""
    graph, order = gtsam.GaussianFactorGraph(), gtsam.Ordering()
    graph.add(gtsam.HessianFactor(_NOW, matrix, right_side, 0.0))
    order.push_back(_NOW)
    conditional = graph.eliminateSequential(order).at(0)  # its matrices are views of its memory
    inverse_root = np.linalg.inv(conditional.R())
    return inverse_root @ conditional.d(), inverse_root @ inverse_root.T
