"""The sliding window of iSAM2 on chains of poses: against the batch solution, few and many poses, long windows."""

import gtsam
import numpy as np
import pytest
from bodycam_ros.estimation.back_end import BackEnd, BackEndError, BatchBackEnd, IncrementalBackEnd

from bodycam_ros.geometry import exp_se3, inverse, log_se3

LOOSE = gtsam.noiseModel.Diagonal.Sigmas(np.full(6, 0.1))
TIGHT = gtsam.noiseModel.Diagonal.Sigmas(np.full(6, 0.01))


class Chain:
    """Poses that sway, each seen at every instant, tied to itself before and to its neighbour."""

    def __init__(self, width: int, seed: int = 0) -> None:
        self.width = width
        self._rng = np.random.default_rng(seed)

    def true(self, index: int) -> np.ndarray:
        phase = 0.1 * index + np.arange(self.width)
        return exp_se3(np.stack([np.sin(phase), np.cos(phase), 0 * phase, phase, 0 * phase, np.sin(phase)], axis=-1))

    def keys(self, index: int) -> list[int]:
        return [index * self.width + row for row in range(self.width)]

    def factors(self, index: int) -> gtsam.NonlinearFactorGraph:
        graph, true = gtsam.NonlinearFactorGraph(), self.true(index)
        for row, key in enumerate(self.keys(index)):
            seen = true[row] @ exp_se3(self._rng.normal(0.0, 0.03, 6))
            graph.add(gtsam.PriorFactorPose3(key, gtsam.Pose3(seen), LOOSE))
            if index:
                step = gtsam.Pose3(inverse(self.true(index - 1)[row]) @ true[row])
                graph.add(gtsam.BetweenFactorPose3(key - self.width, key, step, TIGHT))
            if row:
                graph.add(
                    gtsam.BetweenFactorPose3(key - 1, key, gtsam.Pose3(inverse(true[row - 1]) @ true[row]), TIGHT)
                )
        return graph

    def add_to(self, back_end: BackEnd, index: int, stamp_s: float) -> None:
        start = self.true(index) @ exp_se3(self._rng.normal(0.0, 0.05, (self.width, 6)))
        back_end.update(self.factors(index), dict(zip(self.keys(index), start, strict=True)), stamp_s)


@pytest.mark.parametrize("width", [1, 13])
@pytest.mark.parametrize(("lag_s", "step_s"), [(0.5, 1 / 120), (0.05, 1 / 30)])
def test_agrees_with_the_batch_solution_at_every_rate(width: int, lag_s: float, step_s: float) -> None:
    """Few poses and many instants are more than CCOLAMD can tell apart one by one."""
    solutions = []
    for back_end in (IncrementalBackEnd(lag_s, 1, 1e-4), BatchBackEnd(lag_s)):
        chain = Chain(width)
        for index in range(60):
            chain.add_to(back_end, index, index * step_s)
        back_end.settle()
        solutions.append(back_end.poses(chain.keys(59)))
    assert np.abs(log_se3(inverse(solutions[0]) @ solutions[1])).max() < 2e-3


def test_what_left_the_window_cannot_be_asked_for() -> None:
    back_end, chain = IncrementalBackEnd(0.2, 0, 0.005), Chain(3)
    for index in range(30):
        chain.add_to(back_end, index, index / 30)
    with pytest.raises(BackEndError, match="moved on"):
        back_end.poses(chain.keys(5))


def test_an_instant_may_hang_on_nothing() -> None:
    back_end, chain = IncrementalBackEnd(2.0, 0, 0.005), Chain(2)
    for index in range(60):
        chain.add_to(back_end, index, index / 30)
    for index in range(60, 130):
        alone = gtsam.NonlinearFactorGraph()
        for key, true in zip(chain.keys(index), chain.true(index), strict=True):
            alone.add(gtsam.PriorFactorPose3(key, gtsam.Pose3(true), LOOSE))
        back_end.update(alone, dict(zip(chain.keys(index), chain.true(index), strict=True)), index / 30)
    assert np.abs(log_se3(inverse(back_end.poses(chain.keys(129))) @ chain.true(129))).max() < 1e-6
