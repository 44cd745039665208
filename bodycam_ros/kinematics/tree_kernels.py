"""Trees of segments as kernels: N states, J joints, S segments, K columns of an increment (``TreeTangent``).

Motions (N, 1 + J, 4, 4) are those of the root, world_T_root, and of all joints. ``carriers`` (K) names the one that
each column moves, and ``twists`` (K, 6) how.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.geometry_kernels import (
    compose,
    exp_se3,
    exp_se3_jacobian,
    inverse,
    log_se3,
    orthonormal,
)
from bodycam_ros.kernels import kernel

Array = NDArray[np.float64]
Whole = NDArray[Any]


@kernel("(f8[:, :, :, ::1], f8[:, :, ::1], f8[:, :, ::1], i8[:, ::1], i8)")
def tree_poses(motion: Array, parent_T_joint: Array, joint_T_child: Array, ends: Whole, root: int) -> Array:
    """world_T_segment (N, S, 4, 4), with the tree's frames (J, 4, 4), its ends (J, 2) and the root's row."""
    poses = np.empty(motion.shape)
    for n in range(len(motion)):
        poses[n, root] = motion[n, 0]
        for j in range(len(ends)):
            world_T_joint = compose(poses[n, ends[j, 0]], parent_T_joint[j])
            poses[n, ends[j, 1]] = compose(compose(world_T_joint, motion[n, 1 + j]), joint_T_child[j])
    return poses


@kernel("(f8[:, :, :, ::1], f8[:, ::1], f8[:, ::1], i8[::1])")
def moved_motion(motion: Array, step: Array, twists: Array, carriers: Whole) -> Array:
    """Motions after increments (N, K)."""
    moved = np.empty(motion.shape)
    xi = np.empty((motion.shape[1], 6))
    for n in range(len(motion)):
        xi[:] = 0.0
        for k in range(len(carriers)):
            for i in range(6):
                xi[carriers[k], i] += step[n, k] * twists[k, i]
        for j in range(len(xi)):
            moved[n, j] = compose(motion[n, j], exp_se3(xi[j]))
            moved[n, j, :3, :3] = orthonormal(moved[n, j])
    return moved


@kernel("(f8[:, :, :, ::1], f8[:, :, :, ::1], f8[:, ::1], i8[::1])")
def steps_between(motion: Array, to: Array, twists: Array, carriers: Whole) -> Array:
    """Increments (N, K) from motions to others."""
    steps = np.zeros((len(motion), len(carriers)))
    xi = np.empty((motion.shape[1], 6))
    for n in range(len(motion)):
        for j in range(len(xi)):
            xi[j] = log_se3(compose(inverse(motion[n, j]), to[n, j]))
        for k in range(len(carriers)):
            for i in range(6):
                steps[n, k] += xi[carriers[k], i] * twists[k, i]
    return steps


@kernel("(f8[:, :, :, ::1], i8[::1], f8[:, ::1], i8[::1], f8[:, ::1])")
def segment_tangents(poses: Array, rows: Whole, twists: Array, children: Whole, moves: Array) -> Array:
    """Tangents (N, R, 6, K) of some segments (R rows) in their own axes, at poses (N, S, 4, 4) of all.

    Each column is a twist (K, 6) of one of the segments, its child (K), in its axes; ``moves`` (S, K) is 1 where it
    moves a segment, 0 elsewhere.
    """
    tangents = np.zeros((len(poses), len(rows), 6, len(children)))
    w, v = np.empty(3), np.empty(3)
    for n in range(len(poses)):
        for k in range(len(children)):
            # In the world's axes, about its origin.
            C = poses[n, children[k]]
            for i in range(3):
                w[i] = C[i, 0] * twists[k, 0] + C[i, 1] * twists[k, 1] + C[i, 2] * twists[k, 2]
                v[i] = C[i, 0] * twists[k, 3] + C[i, 1] * twists[k, 4] + C[i, 2] * twists[k, 5]
            for row in range(len(rows)):
                if moves[rows[row], k] == 0.0:
                    continue
                T = poses[n, rows[row]]
                x, y, z = T[0, 3] - C[0, 3], T[1, 3] - C[1, 3], T[2, 3] - C[2, 3]
                u = (v[0] + w[1] * z - w[2] * y, v[1] + w[2] * x - w[0] * z, v[2] + w[0] * y - w[1] * x)
                for i in range(3):
                    tangents[n, row, i, k] = T[0, i] * w[0] + T[1, i] * w[1] + T[2, i] * w[2]
                    tangents[n, row, 3 + i, k] = T[0, i] * u[0] + T[1, i] * u[1] + T[2, i] * u[2]
    return tangents


@kernel("(f8[::1], f8[:, ::1], i8[::1], i8)")
def step_jacobian(step: Array, twists: Array, carriers: Whole, count: int) -> Array:
    """(K, K) how ``count`` motions after an increment (K) move, by increments of their own, when it changes."""
    K = len(carriers)
    jacobian, xi = np.zeros((K, K)), np.zeros((count, 6))
    for k in range(K):
        for i in range(6):
            xi[carriers[k], i] += step[k] * twists[k, i]
    for j in range(count):
        by_change = exp_se3_jacobian(xi[j])
        for a in range(K):
            for b in range(K):
                if carriers[a] == j and carriers[b] == j:
                    for i in range(6):
                        for m in range(6):
                            jacobian[a, b] += twists[a, i] * by_change[i, m] * twists[b, m]
    return jacobian
