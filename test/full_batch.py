"""All instants of a recording at once by gtsam's own Levenberg-Marquardt: slow, and what everything else is held to."""

from collections.abc import Callable

import gtsam
import numpy as np
from bodycam_ros.estimation.back_end import all_poses, back_end_failures
from bodycam_ros.estimation.block_solver import Block

from bodycam_ros.estimation.motion_model import orthonormal
from bodycam_ros.geometry import Array

_MOST_ROUNDS = 20
_ENOUGH = 1e-5  # [rad, m] a round that moves nothing farther is the last


def levenberg_marquardt(
    block: Block, start: Array, most_steps: int, on_step: Callable[[], None] = lambda: None
) -> Array:
    """Poses (T, S, 4, 4) at which a block's errors are least; stands in for ``solve_block``.

    What follows the estimate is made anew between rounds, each of which runs until it has converged.

    Raises:
        BackEndError: gtsam cannot solve it.
    """
    poses = start
    for _ in range(max(most_steps, _MOST_ROUNDS)):
        values = gtsam.Values()
        for key, pose in enumerate(poses.reshape(-1, 4, 4), block.first_key):
            values.insert(key, gtsam.Pose3(pose))
        with back_end_failures():
            graph = gtsam.NonlinearFactorGraph()
            graph.push_back(block.fixed)
            graph.push_back(block.joints(poses))
            motion = block.motion.linearised(poses, block.first_key)
            for place in range(motion.size()):
                graph.add(gtsam.LinearContainerFactor(motion.at(place), values))
            solved = gtsam.LevenbergMarquardtOptimizer(graph, values, gtsam.LevenbergMarquardtParams()).optimize()
        before, poses = poses, orthonormal(all_poses(solved)[1]).reshape(start.shape)
        on_step()
        if np.abs(poses - before).max() < _ENOUGH:
            break
    return poses
