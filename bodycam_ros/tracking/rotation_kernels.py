"""The rotation that most pairs of bearings agree on, of ``rotation``: RANSAC, then two fits to those that agree."""

import math

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.kernels import kernel

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

_REFITS = 2
_SWEEPS = 8  # of Jacobi's rotations; five reach the last digit
_SHORTEST = 1e-9  # a bearing that was sampled twice yields no rotation, but no NaN either


@kernel("(f8[:, ::1], f8[:, ::1], i8[:, ::1], f8, i8)")
def agreed_rotation(
    previous: Array, current: Array, samples: NDArray[np.int64], max_chord: float, min_inliers: int
) -> tuple[Array, Mask]:
    """Find the rotation.

    Args:
        previous, current: (N, 3) unit bearings of the same tracks in two frames.
        samples: (2, H) rows of the pair of bearings that each hypothesis is made of.
        max_chord: how far a bearing may be from where the rotation takes it.
        min_inliers: below so many that agree there is none.

    Returns:
        current_R_previous (3, 3) and the (N,) tracks that agree with it; the identity, and nobody.
    """
    best, least = np.eye(3), math.inf
    for h in range(samples.shape[1]):
        hypothesis = _rotation_of_pair(previous, current, samples[0, h], samples[1, h])
        cost = 0.0
        for i in range(len(previous)):
            cost += min(_chord(hypothesis, previous, current, i), max_chord)
        if cost < least:
            best, least = hypothesis, cost
    inliers = _agreeing(best, previous, current, max_chord)
    for _ in range(_REFITS):
        if inliers.sum() < min_inliers:
            break
        best = _aligned(previous, current, inliers)
        inliers = _agreeing(best, previous, current, max_chord)
    if inliers.sum() < min_inliers:
        return np.eye(3), np.zeros(len(previous), np.bool_)
    return best, inliers


@kernel()
def _rotation_of_pair(previous: Array, current: Array, first: int, second: int) -> Array:
    """Carries a pair of bearings over, by their common triads (Black 1964)."""
    triad_previous = _triad(previous[first], previous[second])
    triad_current = _triad(current[first], current[second])
    R = np.zeros((3, 3))
    for i in range(3):
        for j in range(3):
            for k in range(3):
                R[i, j] += triad_current[i, k] * triad_previous[j, k]
    return R


@kernel()
def _triad(a: Array, b: Array) -> Array:
    """Right-handed frame (3, 3) in columns: between two bearings, across them, and the third."""
    triad = np.empty((3, 3))
    triad[:, 0] = a + b
    _cross(a, b, triad[:, 1])
    for column in range(2):
        squared = 0.0
        for i in range(3):
            squared += triad[i, column] * triad[i, column]
        length = max(math.sqrt(squared), _SHORTEST)
        for i in range(3):
            triad[i, column] /= length
    _cross(triad[:, 0], triad[:, 1], triad[:, 2])
    return triad


@kernel()
def _cross(a: Array, b: Array, result: Array) -> None:
    result[0] = a[1] * b[2] - a[2] * b[1]
    result[1] = a[2] * b[0] - a[0] * b[2]
    result[2] = a[0] * b[1] - a[1] * b[0]


@kernel()
def _chord(R: Array, previous: Array, current: Array, i: int) -> float:
    squared = 0.0
    for row in range(3):
        turned = R[row, 0] * previous[i, 0] + R[row, 1] * previous[i, 1] + R[row, 2] * previous[i, 2]
        squared += (turned - current[i, row]) ** 2
    return math.sqrt(squared)


@kernel()
def _agreeing(R: Array, previous: Array, current: Array, max_chord: float) -> Mask:
    agreeing = np.empty(len(previous), np.bool_)
    for i in range(len(previous)):
        agreeing[i] = _chord(R, previous, current, i) < max_chord
    return agreeing


@kernel()
def _aligned(previous: Array, current: Array, chosen: Mask) -> Array:
    """Least-squares rotation (3, 3) of the chosen bearings (Kabsch 1976)."""
    product = np.zeros((3, 3))
    for n in range(len(previous)):
        if chosen[n]:
            for i in range(3):
                for j in range(3):
                    product[i, j] += current[n, i] * previous[n, j]
    return _nearest_rotation(product)


@kernel()
def _nearest_rotation(M: Array) -> Array:
    """Rotation R (3, 3) of the largest trace of R.T @ M: by Horn's quaternion, which needs no LAPACK."""
    N = np.empty((4, 4))
    N[0, 0] = M[0, 0] + M[1, 1] + M[2, 2]
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        N[1 + i, 1 + i] = M[i, i] - M[j, j] - M[k, k]
        N[0, 1 + i] = N[1 + i, 0] = M[k, j] - M[j, k]
        N[1 + i, 1 + j] = N[1 + j, 1 + i] = M[i, j] + M[j, i]
    w, x, y, z = _largest_eigenvector(N)
    R = np.empty((3, 3))
    R[0, 0], R[0, 1], R[0, 2] = 1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)
    R[1, 0], R[1, 1], R[1, 2] = 2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)
    R[2, 0], R[2, 1], R[2, 2] = 2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)
    return R


@kernel()
def _largest_eigenvector(N: Array) -> tuple[float, float, float, float]:
    """Unit eigenvector of the largest eigenvalue of a symmetric matrix (4, 4), which is changed: Jacobi's rotations."""
    V = np.eye(4)
    for _ in range(_SWEEPS):
        for p in range(3):
            for q in range(p + 1, 4):
                if N[p, q] == 0.0:
                    continue
                ratio = (N[q, q] - N[p, p]) / (2.0 * N[p, q])
                tangent = 1.0 / (abs(ratio) + math.sqrt(ratio * ratio + 1.0))
                if ratio < 0.0:
                    tangent = -tangent
                cosine = 1.0 / math.sqrt(tangent * tangent + 1.0)
                sine = tangent * cosine
                for k in range(4):
                    N[k, p], N[k, q] = cosine * N[k, p] - sine * N[k, q], sine * N[k, p] + cosine * N[k, q]
                    V[k, p], V[k, q] = cosine * V[k, p] - sine * V[k, q], sine * V[k, p] + cosine * V[k, q]
                for k in range(4):
                    N[p, k], N[q, k] = cosine * N[p, k] - sine * N[q, k], sine * N[p, k] + cosine * N[q, k]
    best = 0
    for k in range(1, 4):
        if N[k, k] > N[best, best]:
            best = k
    return V[0, best], V[1, best], V[2, best], V[3, best]
