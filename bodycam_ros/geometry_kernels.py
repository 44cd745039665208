"""Rigid transforms as kernels. Poses (4, 4), tangent vectors (6,)."""

import math

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.kernels import kernel

Array = NDArray[np.float64]

_SMALL_ANGLE = 1e-4
_TINY = 1e-150


@kernel()
def compose(a_T_b: Array, b_T_c: Array) -> Array:
    """a_T_c."""
    a_T_c = np.empty((4, 4))
    for i in range(4):
        for j in range(4):
            total = 0.0
            for k in range(4):
                total += a_T_b[i, k] * b_T_c[k, j]
            a_T_c[i, j] = total
    return a_T_c


@kernel()
def inverse(a_T_b: Array) -> Array:
    """b_T_a."""
    b_T_a = np.eye(4)
    for i in range(3):
        for j in range(3):
            b_T_a[i, j] = a_T_b[j, i]
            b_T_a[i, 3] -= a_T_b[j, i] * a_T_b[j, 3]
    return b_T_a


@kernel("(f8[:, ::1],)")
def exp_se3_rows(xi: Array) -> Array:
    """Transforms (N, 4, 4) of tangent vectors (N, 6)."""
    T = np.empty((len(xi), 4, 4))
    for row in range(len(xi)):
        T[row] = exp_se3(xi[row])
    return T


@kernel("(f8[:, :, ::1],)")
def log_se3_rows(T: Array) -> Array:
    """Tangent vectors (N, 6) of transforms (N, 4, 4)."""
    xi = np.empty((len(T), 6))
    for row in range(len(T)):
        xi[row] = log_se3(T[row])
    return xi


@kernel("(f8[:, :, ::1],)")
def log_so3_rows(R: Array) -> Array:
    """Rotation vectors (N, 3) of rotations (N, 3, 3)."""
    w = np.empty((len(R), 3))
    for row in range(len(R)):
        w[row, 0], w[row, 1], w[row, 2] = _rotation_vector(R[row])
    return w


@kernel("(f8[::1],)")
def exp_se3(xi: Array) -> Array:
    """Transform of a tangent vector, rotation [rad] then translation."""
    x, y, z = xi[0], xi[1], xi[2]
    squared = x * x + y * y + z * z
    angle = math.sqrt(squared) + _TINY
    sine_ratio = math.sin(angle) / angle
    versine_ratio = 0.5 * (math.sin(angle / 2.0) / (angle / 2.0)) ** 2
    if angle < _SMALL_ANGLE:
        third = 1.0 / 6.0 - angle**2 / 120.0
    else:
        third = (1.0 - sine_ratio) / angle**2
    W = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    T = np.eye(4)
    for i in range(3):
        for j in range(3):
            W2 = xi[i] * xi[j] - (squared if i == j else 0.0)
            T[i, j] += sine_ratio * W[i, j] + versine_ratio * W2
            unit = 1.0 if i == j else 0.0
            T[i, 3] += (unit + versine_ratio * W[i, j] + third * W2) * xi[3 + j]
    return T


@kernel()
def orthonormal(M: Array) -> Array:
    """Rotation (3, 3) nearest to a matrix that is one but for rounding: a step of Newton's iteration."""
    R = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            R[i, j] = 1.5 * M[i, j]
            for k in range(3):
                for m in range(3):
                    R[i, j] -= 0.5 * M[i, m] * M[k, m] * M[k, j]
    return R


@kernel("(f8[:, :, ::1],)")
def quaternion_rows(R: Array) -> Array:
    """Unit quaternions (N, 4), x y z w with w >= 0, of rotations (N, 3, 3)."""
    q = np.empty((len(R), 4))
    for row in range(len(R)):
        q[row, 0], q[row, 1], q[row, 2], q[row, 3] = _quaternion(R[row])
    return q


@kernel()
def _rotation_vector(R: Array) -> tuple[float, float, float]:
    x, y, z, w = _quaternion(R)
    sine = math.sqrt(x * x + y * y + z * z) + _TINY
    gain = 2.0 * math.atan2(sine, w) / sine
    return gain * x, gain * y, gain * z


@kernel()
def _quaternion(R: Array) -> tuple[float, float, float, float]:
    xx, yy, zz = R[0, 0], R[1, 1], R[2, 2]
    sums = (1.0 + xx - yy - zz, 1.0 - xx + yy - zz, 1.0 - xx - yy + zz, 1.0 + xx + yy + zz)
    # 4 q q': each row is q times four times one of its components; the row of the largest is the most exact.
    if sums[0] >= sums[1] and sums[0] >= sums[2] and sums[0] >= sums[3]:
        x = sums[0]
        y = R[0, 1] + R[1, 0]
        z = R[0, 2] + R[2, 0]
        w = R[2, 1] - R[1, 2]
    elif sums[1] >= sums[2] and sums[1] >= sums[3]:
        x = R[0, 1] + R[1, 0]
        y = sums[1]
        z = R[1, 2] + R[2, 1]
        w = R[0, 2] - R[2, 0]
    elif sums[2] >= sums[3]:
        x = R[0, 2] + R[2, 0]
        y = R[1, 2] + R[2, 1]
        z = sums[2]
        w = R[1, 0] - R[0, 1]
    else:
        x = R[2, 1] - R[1, 2]
        y = R[0, 2] - R[2, 0]
        z = R[1, 0] - R[0, 1]
        w = sums[3]
    length = math.sqrt(x * x + y * y + z * z + w * w)
    if w < 0.0:
        length = -length
    return x / length, y / length, z / length, w / length


@kernel()
def log_se3(T: Array) -> Array:
    """Tangent vector (6,) of a transform, rotation [rad] then translation."""
    xi = np.empty(6)
    x, y, z = _rotation_vector(T)
    xi[0], xi[1], xi[2] = x, y, z
    squared = x * x + y * y + z * z
    angle = math.sqrt(squared) + _TINY
    if angle < _SMALL_ANGLE:
        second = 1.0 / 12.0 + angle**2 / 720.0
    else:
        half = angle / 2.0
        second = (1.0 - half / math.tan(half)) / (4.0 * half**2)
    W = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    for i in range(3):
        xi[3 + i] = T[i, 3]
        for j in range(3):
            W2 = xi[i] * xi[j] - (squared if i == j else 0.0)
            xi[3 + i] += (-0.5 * W[i, j] + second * W2) * T[j, 3]
    return xi


@kernel("(f8[::1],)")
def log_se3_jacobian(xi: Array) -> Array:
    """J (6, 6): log_se3(exp_se3(-d) exp_se3(xi)) is xi - J d for small d (6,): the inverse of the left Jacobian.

    To the fourth order in xi (Barfoot 2017, eq. 7.94b).
    """
    ad = np.zeros((6, 6))
    for i in range(3):
        a, b = (i + 1) % 3, (i + 2) % 3
        for block in range(2):
            ad[3 * block + a, 3 * block + b], ad[3 * block + b, 3 * block + a] = -xi[i], xi[i]
        ad[3 + a, b], ad[3 + b, a] = -xi[3 + i], xi[3 + i]
    squared, J = np.zeros((6, 6)), np.eye(6)
    for i in range(6):
        for k in range(6):
            for j in range(6):
                squared[i, j] += ad[i, k] * ad[k, j]
    for i in range(6):
        for j in range(6):
            J[i, j] += squared[i, j] / 12.0 - 0.5 * ad[i, j]
            for k in range(6):
                J[i, j] -= squared[i, k] * squared[k, j] / 720.0
    return J


@kernel()
def exp_se3_jacobian(xi: Array) -> Array:
    """J (6, 6): exp_se3(xi + d) is exp_se3(xi) exp_se3(J d) for small d (6,): the right Jacobian, by its series.

    Barfoot 2017, eq. 7.83. Terms of the series are below rounding where the rotation is at most half a turn.
    """
    J = np.eye(6)
    term = np.eye(6)
    product = np.empty((6, 6))
    x, y, z, u, v, w = xi[0], xi[1], xi[2], xi[3], xi[4], xi[5]
    ad = np.zeros((6, 6))
    ad[0, 1], ad[0, 2], ad[1, 0], ad[1, 2], ad[2, 0], ad[2, 1] = -z, y, z, -x, -y, x
    ad[3:, 3:] = ad[:3, :3]
    ad[3, 1], ad[3, 2], ad[4, 0], ad[4, 2], ad[5, 0], ad[5, 1] = -w, v, w, -u, -v, u
    largest = np.abs(ad).max()
    for n in range(1, 40):
        total = 0.0
        for i in range(6):
            for j in range(6):
                product[i, j] = 0.0
                for k in range(6):
                    product[i, j] -= term[i, k] * ad[k, j] / (n + 1)
        for i in range(6):
            for j in range(6):
                term[i, j] = product[i, j]
                J[i, j] += product[i, j]
                total += abs(product[i, j])
        if total < 1e-16 * (1.0 + largest):
            break
    return J


@kernel()
def solve_positive(A: Array, b: Array) -> tuple[Array, bool]:
    """Solution x (N,) of A x = b by Cholesky, and whether A (N, N) is positive definite; reads its lower half alone."""
    size = len(b)
    L, x = np.empty((size, size)), np.empty(size)
    for i in range(size):
        for j in range(i + 1):
            total = A[i, j]
            for k in range(j):
                total -= L[i, k] * L[j, k]
            if i > j:
                L[i, j] = total / L[j, j]
            elif total > 0.0:
                L[i, i] = math.sqrt(total)
            else:
                return x, False
        total = b[i]
        for k in range(i):
            total -= L[i, k] * x[k]
        x[i] = total / L[i, i]
    for i in range(size - 1, -1, -1):
        for k in range(i + 1, size):
            x[i] -= L[k, i] * x[k]
        x[i] /= L[i, i]
    return x, True


@kernel("(f8[:, ::1],)")
def invert_positive(A: Array) -> tuple[Array, bool]:
    """Inverse (N, N) of A by Cholesky, symmetric, and whether A (N, N) is positive definite."""
    size = len(A)
    inverse_A, unit = np.empty((size, size)), np.zeros(size)
    for j in range(size):
        unit[j] = 1.0
        column, found = solve_positive(A, unit)
        unit[j] = 0.0
        if not found:
            return inverse_A, False
        for i in range(j, size):
            inverse_A[i, j] = inverse_A[j, i] = column[i]
    return inverse_A, True
