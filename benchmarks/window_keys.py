"""What gtsam's iSAM2 costs by the keys of a state: python -m benchmarks.window_keys.

Linear factors of the sizes of a body with 16 cameras, so that gtsam's own work is timed: an update with one state,
marginalising the oldest, and the square root of the newest one's information. In turns, medians over 150 states.
"""

import time
from collections.abc import Callable

import gtsam
import numpy as np

from bodycam_ros.geometry import Array

COORDINATES = 42
CAMERA_ROWS = 96
STATES = 200
LENGTH = 5
TURNS = 3

Keys = Callable[[int], list[int]]


def factor(keys: list[int], blocks: list[Array]) -> gtsam.NonlinearFactor:
    """A linear factor."""
    terms = [term for pair in zip(keys, blocks, strict=True) for term in pair]
    values, rows = gtsam.Values(), len(blocks[0])
    for key, block in zip(keys, blocks, strict=True):
        values.insert(key, np.zeros(block.shape[1]))
    linear = gtsam.JacobianFactor(*terms, np.ones(rows), gtsam.noiseModel.Unit.Create(rows))
    return gtsam.LinearContainerFactor(linear, values)


def time_states(size: int, reach: int, with_beside: bool) -> tuple[float, float]:
    """Milliseconds of an update and of a marginal.

    Args:
        size: of a state's variable.
        reach: states before that its motion factor has.
        with_beside: whether a variable of one number is beside each state.
    """
    rng, parameters = np.random.default_rng(0), gtsam.ISAM2Params()
    parameters.relinearizeSkip, parameters.findUnusedFactorSlots = 1 << 30, True
    isam, spent = gtsam.ISAM2(parameters), []
    cameras = np.hstack(
        [np.zeros((CAMERA_ROWS, size - COORDINATES)), rng.normal(0.0, 300.0, (CAMERA_ROWS, COORDINATES))]
    )
    for number in range(STATES):
        started = time.perf_counter()
        graph = gtsam.NonlinearFactorGraph()
        values = gtsam.Values()
        order = gtsam.ISAM2UpdateParams()
        key, beside = gtsam.symbol("x", number), gtsam.symbol("y", number)
        before = [gtsam.symbol("x", each) for each in range(max(0, number - reach), number)]
        values.insert(key, np.zeros(size))
        graph.add(factor([*before, key], [30.0 * np.eye(size)] * (len(before) + 1)))
        graph.add(factor([key], [cameras]))
        last = [*before[1:], key]
        if with_beside:
            values.insert(beside, np.zeros(1))
            graph.add(factor([key, beside], [np.zeros((1, size)), np.eye(1)]))
            last.append(beside)
        if number > reach:
            groups = gtsam.KeyGroupMap()
            for place, each in enumerate(last):
                groups.insert2(each, 1 + place)
            order.constrainedKeys = groups
        isam.update(graph, values, order)
        if number >= LENGTH - 1:
            leaves = gtsam.KeyList()
            if with_beside:
                leaves.push_back(gtsam.symbol("y", number - LENGTH + 1))
            leaves.push_back(gtsam.symbol("x", number - LENGTH + 1))
            isam.marginalizeLeaves(leaves)
        updated = time.perf_counter()
        conditional = isam.marginalFactor(key)
        np.array(conditional.R())
        spent.append((updated - started, time.perf_counter() - updated))
    update, marginal = 1e3 * np.median(np.array(spent)[STATES // 4 :], axis=0)
    return float(update), float(marginal)


def main() -> None:
    """Print a row for each kind of keys and turn."""
    for _ in range(TURNS):
        for name, size, reach, with_beside in (
            ("velocities and coordinates", 2 * COORDINATES, 1, False),
            ("velocities and coordinates, a variable beside", 2 * COORDINATES, 1, True),
            ("coordinates, motion over three states, a variable beside", COORDINATES, 2, True),
        ):
            update, marginal = time_states(size, reach, with_beside)
            print(f"{name:58} update {update:.2f} ms, marginal {marginal:.2f} ms", flush=True)


if __name__ == "__main__":
    main()
