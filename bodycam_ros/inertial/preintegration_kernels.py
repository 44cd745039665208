"""Sums over the samples of an inertial sensor as a kernel: live, some samples of each sensor come with every frame."""

import math

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.kernels import kernel

Array = NDArray[np.float64]

_TINY = 1e-150


@kernel("(f8[::1], f8[:, ::1], f8[:, :, ::1], f8[:, ::1], f8[:, ::1])")
def add_samples(dt: Array, readings: Array, R: Array, once: Array, twice: Array) -> None:
    """Sums after N samples, each from the one before; rows 0 are known, the others are filled in.

    Args:
        dt: (N,) time since the sample before [s].
        readings: (N + 1, 6) angular velocity and acceleration.
        R: (N + 1, 3, 3) orientations.
        once, twice: (N + 1, 12) integrals of R and R a.
    """
    before, after = np.empty(12), np.empty(12)
    for row in range(len(dt)):
        h = dt[row]
        _turn(R[row], 0.5 * h, readings[row], readings[row + 1], R[row + 1])
        _rates(R[row], readings[row], before)
        _rates(R[row + 1], readings[row + 1], after)
        for column in range(12):
            known = once[row, column]
            once[row + 1, column] = known + 0.5 * h * (before[column] + after[column])
            twice[row + 1, column] = (
                twice[row, column] + h * known + h * h * (2.0 * before[column] + after[column]) / 6.0
            )


@kernel()
def _rates(R: Array, reading: Array, rates: Array) -> None:
    """R and R a of an orientation and a reading, into rates (12,)."""
    for i in range(3):
        rates[9 + i] = 0.0
        for j in range(3):
            rates[3 * i + j] = R[i, j]
            rates[9 + i] += R[i, j] * reading[3 + j]


@kernel()
def _turn(R: Array, half: float, first: Array, second: Array, turned: Array) -> None:
    """R turned by the mean of two readings over twice the time ``half`` [s]; made a rotation again by a Newton step."""
    x, y, z = half * (first[0] + second[0]), half * (first[1] + second[1]), half * (first[2] + second[2])
    squared = x * x + y * y + z * z
    angle = math.sqrt(squared) + _TINY
    sine_ratio = math.sin(angle) / angle
    versine_ratio = 0.5 * (math.sin(angle / 2.0) / (angle / 2.0)) ** 2
    w = (x, y, z)
    W = ((0.0, -z, y), (z, 0.0, -x), (-y, x, 0.0))
    M, excess = np.zeros((3, 3)), np.zeros((3, 3))
    for i in range(3):
        for j in range(3):
            for k in range(3):
                unit = 1.0 if k == j else 0.0
                turn = unit + sine_ratio * W[k][j] + versine_ratio * (w[k] * w[j] - unit * squared)
                M[i, j] += R[i, k] * turn
    for i in range(3):
        for j in range(3):
            excess[i, j] = -1.0 if i == j else 0.0
            for k in range(3):
                excess[i, j] += M[k, i] * M[k, j]
    for i in range(3):
        for j in range(3):
            turned[i, j] = M[i, j]
            for k in range(3):
                turned[i, j] -= 0.5 * M[i, k] * excess[k, j]


@kernel("(i8[::1], f8[:, ::1], f8[:, :, ::1], f8[:, ::1], f8[:, ::1], i8, i8, i8, i8)")
def motion_between(
    stamps_ns: NDArray[np.int64],
    readings: Array,
    R: Array,
    once: Array,
    twice: Array,
    first: int,
    second: int,
    start_ns: int,
    end_ns: int,
) -> Array:
    """(54,) the fields of ``Preintegrated`` behind ``seconds``, in their order, between two stamps [ns].

    Args:
        stamps_ns, readings, R, once, twice: sums at N samples.
        first, second: the last samples at or before the stamps.
        start_ns, end_ns: the stamps.
    """
    dt = np.empty(1)
    at_readings, at_R = np.empty((2, 2, 6)), np.empty((2, 2, 3, 3))
    at_once, at_twice = np.empty((2, 2, 12)), np.empty((2, 2, 12))
    for end in range(2):
        node, stamp_ns = (first, start_ns) if end == 0 else (second, end_ns)
        share = 0.0
        following = node
        if node + 1 < len(stamps_ns):
            following = node + 1
            share = (stamp_ns - stamps_ns[node]) / (stamps_ns[following] - stamps_ns[node])
        dt[0] = 1e-9 * (stamp_ns - stamps_ns[node])
        at_R[end, 0] = R[node]
        at_once[end, 0], at_twice[end, 0], at_readings[end, 0] = once[node], twice[node], readings[node]
        for column in range(6):
            at_readings[end, 1, column] = readings[node, column] * (1.0 - share) + readings[following, column] * share
        add_samples(dt, at_readings[end], at_R[end], at_once[end], at_twice[end])
    seconds = 1e-9 * (end_ns - start_ns)
    R1, R2 = at_R[0, 1], at_R[1, 1]
    moved = np.zeros(54)
    for i in range(3):
        for k in range(3):
            velocity = at_once[1, 1, 9 + k] - at_once[0, 1, 9 + k]
            position = at_twice[1, 1, 9 + k] - at_twice[0, 1, 9 + k] - seconds * at_once[0, 1, 9 + k]
            moved[9 + i] += R1[k, i] * velocity
            moved[12 + i] += R1[k, i] * position
            for j in range(3):
                turned = at_once[1, 1, 3 * k + j] - at_once[0, 1, 3 * k + j]
                shifted = at_twice[1, 1, 3 * k + j] - at_twice[0, 1, 3 * k + j] - seconds * at_once[0, 1, 3 * k + j]
                moved[3 * i + j] += R1[k, i] * R2[k, j]
                moved[27 + 3 * i + j] += R2[k, i] * turned
                moved[36 + 3 * i + j] += R1[k, i] * turned
                moved[45 + 3 * i + j] += R1[k, i] * shifted
        moved[15 + i], moved[18 + i] = at_readings[0, 1, i], at_readings[1, 1, i]
    for column in range(6):
        moved[21 + column] = at_readings[1, 1, column] - at_readings[0, 1, column]
    return moved
