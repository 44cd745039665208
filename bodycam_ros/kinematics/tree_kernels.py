"""Trees of segments as kernels: N states, J joints, S segments, K columns of an increment (``TreeTangent``).

Motions (N, 1 + J, 4, 4) are those of the root, world_T_root, and of all joints. Of each column ``carriers`` (K) names
the one that it moves, and ``twists`` (K, 6) how.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.geometry_kernels import compose, exp_se3, inverse, log_se3, orthonormal
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


@kernel("(f8[:, :, :, ::1], f8[:, :, ::1], f8[:, ::1])")
def segment_tangents(world_T_segment: Array, world_twists: Array, moves: Array) -> Array:
    """Tangents (N, S, 6, K) of segments (N, S, 4, 4), in their own axes, that twists (N, 6, K) in the world's make.

    ``moves`` (S, K) is 1 where a twist moves a segment, 0 elsewhere.
    """
    N, S, K = world_T_segment.shape[0], world_T_segment.shape[1], world_twists.shape[2]
    tangents = np.zeros((N, S, 6, K))
    v = np.empty(3)
    for n in range(N):
        for s in range(S):
            T = world_T_segment[n, s]
            for k in range(K):
                if moves[s, k] == 0.0:
                    continue
                w = world_twists[n, :3, k]
                for i in range(3):
                    a, b = (i + 1) % 3, (i + 2) % 3
                    v[i] = world_twists[n, 3 + i, k] + w[a] * T[b, 3] - w[b] * T[a, 3]
                for i in range(3):
                    for j in range(3):
                        tangents[n, s, i, k] += T[j, i] * w[j]
                        tangents[n, s, 3 + i, k] += T[j, i] * v[j]
    return tangents
