"""Many instants at once: Gauss-Newton by gtsam's sparse elimination, with steps that never make it worse.

Cameras, joints and whatever else the instants brought are gtsam's own factors, so all of the work is done in C++. What
must follow the estimate (a ball's present rotation, the motion over three instants) is made anew at every step.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import gtsam
import numpy as np
from numpy.typing import NDArray

from bodycam_ros.solving.back_end import BackEndError, all_poses, back_end_failures
from bodycam_ros.solving.motion import orthonormal
from bodycam_ros.solving.smooth_motion import SmoothMotion

Array = NDArray[np.float64]

_ENOUGH = 1e-4  # [rad, m] a step that moves nothing farther has arrived
_SMALLEST_STEP = 0.05  # of a step that made it worse, tried before the estimate is left as it is
_DAMPING = (0.0, 1e-2, 1.0, 100.0)  # information [1/rad^2, 1/m^2] added to all poses where there is none to solve by


@dataclass
class Block:
    """What is known of T instants.

    Attributes:
        first_key: of the first segment at the first instant; keys count segments, then instants.
        fixed: factors that do not depend on the estimate.
        joints: those that are made around poses (T, S, 4, 4).
        motion: how the segments move from instant to instant.
    """

    first_key: int
    fixed: gtsam.NonlinearFactorGraph
    joints: Callable[[Array], gtsam.NonlinearFactorGraph]
    motion: SmoothMotion


class BlockSolver(Protocol):
    """Solves a block; ``solve_block`` is one."""

    def __call__(
        self, block: Block, start: Array, most_steps: int, on_step: Callable[[], None] = lambda: None
    ) -> Array:
        """Poses (T, S, 4, 4) from start values (T, S, 4, 4)."""


@dataclass
class _Estimate:
    values: gtsam.Values
    poses: Array
    joints: gtsam.NonlinearFactorGraph
    error: float


def solve_block(block: Block, start: Array, most_steps: int, on_step: Callable[[], None] = lambda: None) -> Array:
    """Poses (T, S, 4, 4) at which the block's errors are least, from start values (T, S, 4, 4).

    Args:
        block: what is known.
        start: near the solution.
        most_steps: after which it is left as it is.
        on_step: called after each of them.

    Raises:
        BackEndError: gtsam cannot solve it.
    """
    values = gtsam.Values()
    for key, pose in enumerate(start.reshape(-1, 4, 4), block.first_key):
        values.insert(key, gtsam.Pose3(pose))
    with back_end_failures():
        now = _estimate(block, values, start.shape)
        ordering: gtsam.Ordering | None = None
        for _ in range(most_steps):
            linear = _linearised(block, now)
            ordering = ordering or gtsam.Ordering.ColamdGaussianFactorGraph(linear)
            step = _step(linear, ordering, block.first_key)
            following = _following(block, now, step)
            on_step()
            if following is None:
                break
            now = following
            if np.abs(step.vector()).max() < _ENOUGH:
                break
    return now.poses


def _linearised(block: Block, at: _Estimate) -> gtsam.GaussianFactorGraph:
    linear = block.fixed.linearize(at.values)
    linear.push_back(at.joints.linearize(at.values))
    linear.push_back(block.motion.linearised(at.poses, block.first_key))
    return linear


def _step(linear: gtsam.GaussianFactorGraph, ordering: gtsam.Ordering, first_key: int) -> gtsam.VectorValues:
    """The step that is least squares; damped where nothing tells of a pose.

    Raises:
        BackEndError: no damping makes it solvable.
    """
    unit = gtsam.noiseModel.Unit.Create(6)
    for damping in _DAMPING:
        damped = linear.clone() if damping else linear
        for key in range(first_key, first_key + ordering.size()) if damping else ():
            damped.push_back(gtsam.JacobianFactor(key, np.sqrt(damping) * np.eye(6), np.zeros(6), unit))
        try:
            step = damped.optimize(ordering)
        except RuntimeError:
            continue
        if np.isfinite(step.vector()).all():
            return step
    raise BackEndError("no damping makes the recording solvable")


def _following(block: Block, now: _Estimate, step: gtsam.VectorValues) -> _Estimate | None:
    """The estimate after a step, shortened until it is no worse; None if none is."""
    share = 1.0
    while share > _SMALLEST_STEP:
        after = _estimate(block, now.values.retract(step.scale(share)), now.poses.shape)
        if after.error <= now.error:
            return after
        share *= 0.5
    return None


def _estimate(block: Block, values: gtsam.Values, shape: Sequence[int]) -> _Estimate:
    poses = orthonormal(all_poses(values)[1]).reshape(shape)
    joints = block.joints(poses)
    error = block.fixed.error(values) + joints.error(values) + block.motion.error(poses)
    return _Estimate(values, poses, joints, error)
