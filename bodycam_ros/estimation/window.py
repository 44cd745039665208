"""The window of states that iSAM2 solves (Kaess et al. 2012): gtsam's ``ISAM2``, whose oldest states are marginalised.

Every state is one variable. A new state comes with its factors; gtsam re-eliminates what they affect, relinearises what
moved, and marginalises states that are published. Estimates and covariances are its own.
"""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager

import gtsam
import numpy as np

from bodycam_ros.estimation.coordinates import Chart, Coordinates
from bodycam_ros.estimation.factors.factor import state_key
from bodycam_ros.geometry import Array

_RELINEARISE = 0.05  # [rad], [m] by which coordinates move before their factors are linearised anew
_ITERATIONS = 3  # of it at most in one update
_ZERO = np.zeros(1)
_ONE = np.eye(1)
_UNIT = gtsam.noiseModel.Unit.Create(1)
_WILDFIRE = 1e-5  # [rad], [m] change of a state below which older ones are not updated


class WindowError(Exception):
    """gtsam could not solve the window; what it holds is no longer valid."""


class Window:
    """States from the oldest that waits to the newest.

    The states are a chain, and are always eliminated in the order of time: so the oldest is a leaf of the Bayes tree,
    and may be marginalised. An update eliminates the newest two alone. Where an estimate has moved away from where its
    factors were linearised, all states whose threshold is exceeded are relinearised, and the window is eliminated anew.

    Args:
        count: K of the body's coordinates.
        relinearises: whether it does so; a recording that is solved again as a whole has no need of it.
    """

    def __init__(self, count: int, relinearises: bool = True) -> None:
        parameters, thresholds = gtsam.ISAM2Params(), gtsam.ISAM2ThresholdMap()
        thresholds.insert(("x", np.append(np.full(count, np.inf), np.full(count, _RELINEARISE))))
        thresholds.insert(("y", np.ones(1)))
        parameters.setRelinearizeThreshold(thresholds)
        parameters.relinearizeSkip = 1 << 30  # where it is asked for
        parameters.findUnusedFactorSlots = True
        parameters.setOptimizationParams(gtsam.ISAM2GaussNewtonParams(_WILDFIRE))
        self._isam = gtsam.ISAM2(parameters)
        self._count = count
        self._relinearises = relinearises
        self._charts: dict[int, Chart] = {}

    def add(self, number: int, chart: Chart, factors: gtsam.NonlinearFactorGraph, oldest: int) -> None:
        """Add a state at the origin of its chart, with its factors; states before the oldest are marginalised.

        Raises:
            WindowError: the factors do not determine the states; the window is of no more use.
        """
        graph, values = gtsam.NonlinearFactorGraph(factors), gtsam.Values()
        key, beside = state_key(number), _key_beside(number)
        values.insert(key, np.zeros(2 * chart.size))
        values.insert(beside, _ZERO)
        # A variable beside the newest state, on which nothing depends, gives that state a clique of its own in the
        # Bayes tree: an update eliminates two states instead of three, and the marginal of the newest is at hand
        # (0.43 ms instead of 0.98).
        pair = gtsam.JacobianFactor(key, np.zeros((1, 2 * chart.size)), beside, _ONE, _ZERO, _UNIT)
        graph.add(gtsam.LinearContainerFactor(pair, values))
        order = gtsam.ISAM2UpdateParams()
        if self._charts:
            order.constrainedKeys = _groups([key, beside])
        self._charts[number] = chart
        with _failures():
            self._isam.update(graph, values, order)
            if self._relinearises:
                self.relinearise()
            for published in [each for each in self._charts if each < oldest]:
                leaves = gtsam.KeyList()
                leaves.push_back(_key_beside(published))
                leaves.push_back(state_key(published))
                self._isam.marginalizeLeaves(leaves)
                del self._charts[published]

    def relinearise(self) -> None:
        """Linearise the factors of states anew that moved, until none does.

        Raises:
            WindowError: as ``add``.
        """
        for _ in range(_ITERATIONS):
            delta = self._isam.getDelta()
            if max(np.abs(delta.at(state_key(each))[self._count :]).max() for each in self._charts) < _RELINEARISE:
                return
            order, keys = gtsam.ISAM2UpdateParams(), gtsam.KeyList()
            chain = [key for number in self._charts for key in (_key_beside(number), state_key(number))]
            # The last two exchanged: what is beside the newest state is eliminated after it.
            order.constrainedKeys = _groups([*chain[:-2], chain[-1], chain[-2]], first=0)
            for key in chain:
                keys.push_back(key)
            order.extraReelimKeys, order.force_relinearize = keys, True
            with _failures():
                self._isam.update(gtsam.NonlinearFactorGraph(), gtsam.Values(), order)

    def __contains__(self, number: int) -> bool:
        """Whether a state is among the window's."""
        return number in self._charts

    def vector(self, number: int) -> Array:
        """(2K,) estimate of a state, about the origin of its chart."""
        x: Array = self._isam.calculateEstimateVector(state_key(number))
        return x

    def at(self, number: int) -> Coordinates:
        """Coordinates of a state given all measurements of the window."""
        return self._charts[number].at(self.vector(number))

    def square_root(self, number: int) -> Array:
        """(2K, 2K) upper triangular square root of the information of a state about its estimate.

        Raises:
            WindowError: as ``add``.
        """
        with _failures():
            conditional = self._isam.marginalFactor(state_key(number))
        # The matrix is a view of the conditional's memory.
        return np.array(conditional.R())


@contextmanager
def _failures() -> Iterator[None]:
    """What gtsam raises as ``WindowError``."""
    try:
        yield
    except (IndexError, RuntimeError, ValueError) as error:
        raise WindowError(str(error)) from error


def _key_beside(number: int) -> int:
    key: int = gtsam.symbol("y", number)
    return key


def _groups(keys: Iterable[int], first: int = 1) -> gtsam.KeyGroupMap:
    """An order of elimination: keys one after the other, and all others before them."""
    groups = gtsam.KeyGroupMap()
    for place, key in enumerate(keys):
        groups.insert2(key, first + place)
    return groups
