"""Integrals over the samples of an inertial sensor as kernels.

A row of sums (39) at a stamp is the orientation (9), integrals of R and R a, once (12) and twice (12), and the reading.
"""

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.geometry_kernels import exp_se3, orthonormal
from bodycam_ros.kernels import kernel

Array = NDArray[np.float64]
Stamps = NDArray[np.int64]

_COLUMNS = 39
_ONCE, _TWICE, _READING = 9, 21, 33  # first columns


@kernel("(i8[::1], f8[:, ::1], i8[::1])")
def sums_at(stamps_ns: Stamps, readings: Array, at_ns: Stamps) -> Array:
    """(T, 39) sums at T stamps, from the first sample on; readings are linear between samples, the last one holds.

    Args:
        stamps_ns, readings: (N), (N, 6) increasing stamps [ns], and angular velocity and acceleration.
        at_ns: (T) stamps [ns], not before the first sample, and not decreasing.
    """
    found = np.empty((len(at_ns), _COLUMNS))
    row, after = np.zeros(_COLUMNS), np.empty(_COLUMNS)
    row[0] = row[4] = row[8] = 1.0
    row[_READING:] = readings[0]
    node = 0
    for number in range(len(at_ns)):
        while node + 1 < len(stamps_ns) and stamps_ns[node + 1] <= at_ns[number]:
            after[_READING:] = readings[node + 1]
            _advance(1e-9 * (stamps_ns[node + 1] - stamps_ns[node]), row, after)
            row[:] = after
            node += 1
        following, ahead_ns = min(node + 1, len(stamps_ns) - 1), at_ns[number] - stamps_ns[node]
        share = ahead_ns / max(stamps_ns[following] - stamps_ns[node], 1)
        for column in range(6):
            change = readings[following, column] - readings[node, column]
            found[number, _READING + column] = readings[node, column] + share * change
        _advance(1e-9 * ahead_ns, row, found[number])
    return found


@kernel()
def _advance(h: float, before: Array, after: Array) -> None:
    """Sums a time [s] after others, which are known but for the reading; readings are linear between the two."""
    xi = np.zeros(6)
    for i in range(3):
        xi[i] = 0.5 * h * (before[_READING + i] + after[_READING + i])
    turn, M = exp_se3(xi), np.zeros((3, 3))
    for i in range(3):
        for j in range(3):
            for k in range(3):
                M[i, j] += before[3 * i + k] * turn[k, j]
    R = orthonormal(M)
    for i in range(3):
        for j in range(3):
            after[3 * i + j] = R[i, j]
    for column in range(12):
        first, second = _rate(before, column), _rate(after, column)
        known = before[_ONCE + column]
        after[_ONCE + column] = known + 0.5 * h * (first + second)
        after[_TWICE + column] = before[_TWICE + column] + h * known + h * h * (2.0 * first + second) / 6.0


@kernel()
def _rate(row: Array, column: int) -> float:
    """What is summed up: R by rows, then R a."""
    if column < 9:
        return float(row[column])
    i, force = 3 * (column - 9), _READING + 3
    return float(row[i] * row[force] + row[i + 1] * row[force + 1] + row[i + 2] * row[force + 2])
