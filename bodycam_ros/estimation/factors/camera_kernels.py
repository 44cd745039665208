"""Poses of segments by cameras (A eq. 8, first term), linearised in a body's coordinates, as kernels."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.geometry_kernels import compose, inverse, log_se3, log_se3_jacobian
from bodycam_ros.kernels import kernel

Array = NDArray[np.float64]


@kernel("(f8[:, :, ::1], i8[::1], f8[:, :, ::1], f8[:, :, ::1], f8)")
def camera_errors(poses: Array, rows: NDArray[Any], measured: Array, root: Array, sigmas: float) -> Array:
    """Errors (6 N,) of N measured poses, half of whose squares is Cauchy's loss; arguments as ``camera_rows``."""
    errors = np.empty(6 * len(rows))
    for n in range(len(rows)):
        r = log_se3(compose(inverse(poses[rows[n]]), measured[n]))
        squared = 0.0
        for i in range(6):
            total = 0.0
            for j in range(i, 6):
                total += root[n, i, j] * r[j]
            errors[6 * n + i] = -total
            squared += total * total
        if squared > 0.0 and sigmas < np.inf:
            shrunk = math.sqrt(sigmas**2 * math.log1p(squared / sigmas**2) / squared)
            for i in range(6):
                errors[6 * n + i] *= shrunk
    return errors


@kernel("(f8[:, :, ::1], f8[:, :, ::1], i8[::1], f8[:, :, ::1], f8[:, :, ::1], f8)")
def camera_rows(
    poses: Array, jacobians: Array, rows: NDArray[Any], measured: Array, root: Array, sigmas: float
) -> tuple[Array, Array]:
    """Errors (6 N,) of N measured poses in sigmas, and their Jacobian (6 N, K), each camera's rows by its weight.

    Args:
        poses: (S, 4, 4) of all segments, about which the residuals are linearised.
        jacobians: (S, 6, K) of these.
        rows: (N,) the measured segments.
        measured: (N, 4, 4) world_T_segment.
        root: (N, 6, 6) upper triangular square root of each one's information.
        sigmas: from which on a measurement counts less (Black and Rangarajan 1996: Cauchy's weight); or infinity.
    """
    count, size = len(rows), jacobians.shape[2]
    errors = np.empty(6 * count)
    by_step = np.zeros((6 * count, size))
    scaled = np.empty((6, 6))
    for n in range(count):
        tangents = jacobians[rows[n]]
        r = log_se3(compose(inverse(poses[rows[n]]), measured[n]))
        by_tangent, squared = log_se3_jacobian(r), 0.0
        for i in range(6):
            total = 0.0
            for j in range(i, 6):
                total += root[n, i, j] * r[j]
            errors[6 * n + i] = -total
            squared += total * total
        weight = math.sqrt(1.0 / (1.0 + squared / sigmas**2))
        for i in range(6):
            errors[6 * n + i] *= weight
            for k in range(6):
                scaled[i, k] = 0.0
                for j in range(i, 6):
                    scaled[i, k] += weight * root[n, i, j] * by_tangent[j, k]
        for k in range(size):
            # A segment is moved by the columns between it and the root alone.
            moves = 0.0
            for i in range(6):
                moves += abs(tangents[i, k])
            if moves != 0.0:
                for i in range(6):
                    for j in range(6):
                        by_step[6 * n + i, k] += scaled[i, j] * tangents[j, k]
    return errors, by_step


@kernel("(f8[:, :, ::1], f8[:, :, ::1], i8[::1], f8[:, :, ::1], f8[:, :, ::1])")
def camera_equations(
    poses: Array, jacobians: Array, rows: NDArray[Any], measured: Array, information: Array
) -> tuple[Array, Array, Array, Array]:
    """Matrix (K, K) and right side (K,) of N measured poses; their residuals (N, 6) and Jacobians (N, 6, K).

    Args:
        poses: (S, 4, 4) of all segments, about which the residuals are linearised.
        jacobians: (S, 6, K) of these.
        rows: (N,) the measured segments.
        measured: (N, 4, 4) world_T_segment.
        information: (N, 6, 6) of each.
    """
    count, size = len(rows), jacobians.shape[2]
    A, b = np.zeros((size, size)), np.zeros(size)
    residuals, by_step = np.empty((count, 6)), np.zeros((count, 6, size))
    weighted, columns = np.empty((6, size)), np.empty(size, np.int64)
    for n in range(count):
        tangents = jacobians[rows[n]]
        r = residuals[n]
        J = by_step[n]
        W = information[n]
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
        Wr = np.zeros(6)
        for i in range(6):
            for j in range(6):
                Wr[i] += W[i, j] * r[j]
        for c in range(used):
            k = columns[c]
            for i in range(6):
                for j in range(6):
                    J[i, k] += by_tangent[i, j] * tangents[j, k]
            for i in range(6):
                weighted[i, c] = 0.0
                for j in range(6):
                    weighted[i, c] += W[i, j] * J[j, k]
                b[k] += Wr[i] * J[i, k]
        for c in range(used):
            for d in range(c + 1):
                total = 0.0
                for i in range(6):
                    total += J[i, columns[c]] * weighted[i, d]
                A[columns[c], columns[d]] += total
                A[columns[d], columns[c]] = A[columns[c], columns[d]]
    return A, b, residuals, by_step
