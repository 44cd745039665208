"""Sums over the samples of an inertial sensor as kernels: live, some samples of each sensor come with every frame.

A row of sums (39) at a stamp is the orientation (9), integrals of R and R a, once (12) and twice (12), and the reading.
"""

import math

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.geometry_kernels import exp_se3, orthonormal
from bodycam_ros.kernels import kernel

Array = NDArray[np.float64]
Stamps = NDArray[np.int64]

COLUMNS = 39
"""Of a row of sums."""

_ONCE, _TWICE, _READING = 9, 21, 33  # first columns
_GAP_NS = 30_000_000  # between neighbouring samples; a longer gap is not integrated across
_BACK_NS = 1_000_000_000  # by which stamps go back where time restarts, and not because messages were exchanged


@kernel("(i8[::1], f8[:, ::1], i8[::1], i8[::1], f8[:, ::1], i8)")
def add_samples(added_ns: Stamps, readings: Array, stamps_ns: Stamps, gaps: Stamps, sums: Array, count: int) -> int:
    """Sums after more samples, each from the one before; how many rows are in use then.

    Samples that are not finite, or whose stamp does not increase, are left out.

    Args:
        added_ns, readings: (M), (M, 6) stamps [ns], and angular velocity and acceleration.
        stamps_ns, gaps, sums: (N), (N), (N, 39) stamps [ns], count of gaps before, and sums; with room for M more.
        count: rows in use.
    """
    for row in range(len(added_ns)):
        stamp_ns = added_ns[row]
        is_finite = True
        for column in range(6):
            is_finite = is_finite and math.isfinite(readings[row, column])
        if count > 0 and stamp_ns < stamps_ns[count - 1] - _BACK_NS:
            count = 0
        if not is_finite or (count > 0 and stamp_ns <= stamps_ns[count - 1]):
            continue
        stamps_ns[count], sums[count, _READING:] = stamp_ns, readings[row]
        if count == 0:
            gaps[0], sums[0, :_READING] = 0, 0.0
            sums[0, 0] = sums[0, 4] = sums[0, 8] = 1.0
        else:
            pause_ns = stamp_ns - stamps_ns[count - 1]
            gaps[count] = gaps[count - 1] + (1 if pause_ns > _GAP_NS else 0)
            _advance(1e-9 * pause_ns, sums[count - 1], sums[count])
        count += 1
    return count


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


@kernel("(i8[::1], f8[:, ::1], i8[::1], i8[::1])")
def sums_at(stamps_ns: Stamps, sums: Array, nodes: Stamps, at_ns: Stamps) -> Array:
    """(T, 39) sums at T stamps.

    Args:
        stamps_ns, sums: (N), (N, 39) at the samples.
        nodes, at_ns: (T) the last samples at or before the stamps, and the stamps.
    """
    found = np.empty((len(at_ns), COLUMNS))
    for row in range(len(at_ns)):
        node = nodes[row]
        following = min(node + 1, len(stamps_ns) - 1)
        ahead_ns = at_ns[row] - stamps_ns[node]
        share = ahead_ns / max(stamps_ns[following] - stamps_ns[node], 1)
        for column in range(_READING, COLUMNS):
            found[row, column] = sums[node, column] + share * (sums[following, column] - sums[node, column])
        _advance(1e-9 * ahead_ns, sums[node], found[row])
    return found


@kernel("(i8[::1], f8[:, ::1], i8[::1], i8[::1])")
def motion_between(stamps_ns: Stamps, sums: Array, nodes: Stamps, ends_ns: Stamps) -> Array:
    """(54,) the fields of ``Preintegrated`` behind ``seconds``, in their order, between two stamps; as ``sums_at``."""
    ends = sums_at(stamps_ns, sums, nodes, ends_ns)
    start, end = ends[0], ends[1]
    seconds = 1e-9 * (ends_ns[1] - ends_ns[0])
    once, twice = np.empty(12), np.empty(12)
    for column in range(12):
        known = start[_ONCE + column]
        once[column] = end[_ONCE + column] - known
        twice[column] = end[_TWICE + column] - start[_TWICE + column] - seconds * known
    moved = np.zeros(54)
    for i in range(3):
        for k in range(3):
            by_start, by_end = start[3 * k + i], end[3 * k + i]
            moved[9 + i] += by_start * once[9 + k]
            moved[12 + i] += by_start * twice[9 + k]
            for j in range(3):
                moved[3 * i + j] += by_start * end[3 * k + j]
                moved[27 + 3 * i + j] += by_end * once[3 * k + j]
                moved[36 + 3 * i + j] += by_start * once[3 * k + j]
                moved[45 + 3 * i + j] += by_start * twice[3 * k + j]
        moved[15 + i], moved[18 + i] = start[_READING + i], end[_READING + i]
    for column in range(6):
        moved[21 + column] = end[_READING + column] - start[_READING + column]
    return moved
