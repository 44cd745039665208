"""Poses of segments by cameras (A eq. 8, first term) as normal equations of a body's coordinates, as kernels."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.geometry_kernels import compose, inverse, log_se3, log_se3_jacobian
from bodycam_ros.kernels import kernel

Array = NDArray[np.float64]


@kernel("(f8[:, :, ::1], f8[:, :, ::1], i8[::1], f8[:, :, ::1], f8[:, :, ::1], f8)")
def camera_equations(
    poses: Array, jacobians: Array, rows: NDArray[Any], measured: Array, information: Array, sigmas: float
) -> tuple[Array, Array, Array, Array]:
    """Matrix (K, K) and right side (K,) of N measured poses; their residuals (N, 6) and Jacobians (N, 6, K).

    Args:
        poses: (S, 4, 4) of all segments, about which the residuals are linearised.
        jacobians: (S, 6, K) of these.
        rows: (N,) the measured segments.
        measured: (N, 4, 4) world_T_segment.
        information: (N, 6, 6) of each.
        sigmas: from which on a measurement counts less (Black and Rangarajan 1996: Cauchy's weight); or infinity.
    """
    count, size = len(rows), jacobians.shape[2]
    A, b = np.zeros((size, size)), np.zeros(size)
    residuals, by_step = np.empty((count, 6)), np.zeros((count, 6, size))
    weighted, columns = np.empty((6, size)), np.empty(size, np.int64)
    for n in range(count):
        tangents, r, J, W = jacobians[rows[n]], residuals[n], by_step[n], information[n]
        r[:] = log_se3(compose(inverse(poses[rows[n]]), measured[n]))
        by_tangent = log_se3_jacobian(r)
        used = 0
        for k in range(size):
            # A segment is moved by the columns between it and the root alone.
            moves = 0.0
            for i in range(6):
                moves += abs(tangents[i, k])
            if moves != 0.0:
                columns[used] = k
                used += 1
        squared, Wr = 0.0, np.zeros(6)
        for i in range(6):
            for j in range(6):
                Wr[i] += W[i, j] * r[j]
            squared += r[i] * Wr[i]
        weight = 1.0 / (1.0 + squared / sigmas**2)
        for c in range(used):
            k = columns[c]
            for i in range(6):
                for j in range(6):
                    J[i, k] += by_tangent[i, j] * tangents[j, k]
            for i in range(6):
                weighted[i, c] = 0.0
                for j in range(6):
                    weighted[i, c] += weight * W[i, j] * J[j, k]
                b[k] += weight * Wr[i] * J[i, k]
        for c in range(used):
            for d in range(c + 1):
                total = 0.0
                for i in range(6):
                    total += J[i, columns[c]] * weighted[i, d]
                A[columns[c], columns[d]] += total
                A[columns[d], columns[c]] = A[columns[c], columns[d]]
    return A, b, residuals, by_step
