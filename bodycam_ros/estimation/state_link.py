"""What a state follows from: the state before, the motion since, what was measured of both; its way into the window.

The first pass over a recording and the second one, in which unobserved joints are known better, take the same way.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import gtsam

from bodycam_ros.estimation.coordinates import Chart, Coordinates
from bodycam_ros.estimation.factors.factor import StateFactor, on_state, on_step, state_key
from bodycam_ros.estimation.factors.motion import Motion
from bodycam_ros.estimation.factors.segment_steps import SegmentStep, SegmentSteps
from bodycam_ros.estimation.solved_state import SolvedState
from bodycam_ros.estimation.state_solution import Prediction, predict_state
from bodycam_ros.estimation.window import Window
from bodycam_ros.geometry import Array


@dataclass(frozen=True, eq=False)
class Initial:
    """Where some or all coordinates of a state begin.

    Attributes:
        at: coordinates and velocities.
        sigmas: (2K) of velocities, then coordinates.
    """

    at: Coordinates
    sigmas: Array

    def factor(self, key: int, chart: Chart) -> gtsam.NonlinearFactor:
        """The prior as gtsam's ``PriorFactorVector``."""
        noise = gtsam.noiseModel.Diagonal.Sigmas(self.sigmas)
        return gtsam.PriorFactorVector(key, chart.vector(self.at), noise)


@dataclass(frozen=True, eq=False)
class StateLink:
    """What a state follows from.

    Attributes:
        before: the state before; None at a first state.
        motion: prior since then; None at a first state.
        steps: measured between the two.
        initial: of what begins with this state, if anything.
        prediction: by all of these.
    """

    before: SolvedState | None
    motion: Motion | None
    steps: tuple[SegmentStep, ...]
    initial: Initial | None
    prediction: Prediction

    @staticmethod
    def first(initial: Initial) -> "StateLink":
        """The link of a first state."""
        return StateLink(None, None, (), initial, Prediction.first(initial.at, initial.sigmas))

    @staticmethod
    def after(
        window: Window,
        before: SolvedState,
        motion: Motion,
        steps: tuple[SegmentStep, ...],
        initial: Initial | None = None,
    ) -> "StateLink":
        """The link to the newest state of a window."""
        chart = Chart(initial.at if initial else motion.predict(window.at(before.number)))
        graph = _factors_between((0, 1), (before.chart, chart), motion, steps)
        if initial:
            graph.add(initial.factor(1, chart))
        x = window.vector(before.number)
        prediction = predict_state(before.chart, x, before.square_root, chart, graph, motion.dt_s)
        return StateLink(before, motion, steps, initial, prediction)

    @property
    def number(self) -> int:
        """Number of the state."""
        return self.before.number + 1 if self.before else 0

    def enter(
        self,
        window: Window,
        chart: Chart,
        resting: Iterable[SegmentStep],
        measured: list[StateFactor],
        oldest: int,
    ) -> Array:
        """Solve a window with the state.

        Args:
            window: with the state before.
            chart: of the state.
            resting: points that rest, beside the other steps.
            measured: factors of the state.
            oldest: number of the oldest state that is kept.

        Returns:
            Square root (2K, 2K) of the state's information.

        Raises:
            WindowError: gtsam cannot solve it.
        """
        key, graph = state_key(self.number), gtsam.NonlinearFactorGraph()
        if self.before is not None and self.motion is not None:
            keys, charts = (state_key(self.before.number), key), (self.before.chart, chart)
            graph = _factors_between(keys, charts, self.motion, (*self.steps, *resting))
        if self.initial:
            graph.add(self.initial.factor(key, chart))
        return self._solved(window, chart, graph, measured, oldest)

    def restart(self, window: Window, chart: Chart, measured: list[StateFactor]) -> Array:
        """Enter an empty window, as ``enter`` does, with the prediction in place of the state before."""
        graph = gtsam.NonlinearFactorGraph()
        graph.add(self.prediction.factor(state_key(self.number), chart))
        return self._solved(window, chart, graph, measured, self.number)

    def _solved(
        self,
        window: Window,
        chart: Chart,
        graph: gtsam.NonlinearFactorGraph,
        measured: list[StateFactor],
        oldest: int,
    ) -> Array:
        """Square root (2K, 2K) of the state's information, in a window with all of its factors."""
        if measured:
            graph.add(on_state(state_key(self.number), chart, measured))
        window.add(self.number, chart, graph, oldest)
        return window.square_root(self.number)


def _factors_between(
    keys: tuple[int, int], charts: tuple[Chart, Chart], motion: Motion, steps: tuple[SegmentStep, ...]
) -> gtsam.NonlinearFactorGraph:
    graph = gtsam.NonlinearFactorGraph()
    graph.add(motion.factor(keys, charts))
    if steps:
        graph.add(on_step(keys, charts, SegmentSteps(steps)))
    return graph
