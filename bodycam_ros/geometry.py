"""Rigid transforms, rotations and their averages, as plain NumPy arrays.

``a_T_b`` is a (4, 4) matrix that maps coordinates in frame b to frame a. Tangent vectors are gtsam's: rotation [rad]
first, then translation, in the moving frame: ``a_T_b @ exp_se3(xi)``. Functions marked (...) work on any leading shape;
where it costs most, one alone is left to ``geometry_kernels``.
"""

import numpy as np
from numpy.typing import NDArray

from bodycam_ros import geometry_kernels
from bodycam_ros.kernels import as_rows

Array = NDArray[np.float64]

_IDENTITY = np.eye(3)
_GENERATORS = np.array(
    [[0, 0, 0, 0, 0, -1, 0, 1, 0], [0, 0, 1, 0, 0, 0, -1, 0, 0], [0, -1, 0, 1, 0, 0, 0, 0, 0]], np.float64
)  # a vector's components into its matrix (3, 9)
_SMALL_ANGLE = 1e-4  # [rad] below it, two terms of a series are exact to rounding
_NEARLY = 1e-7  # a matrix that is a rotation to this is one to rounding after a step of Newton's iteration
_DEGENERATE = 1e-9  # spread of points across their longest axis, relative to that axis, that counts as none
_MEDIAN_ITERATIONS = 100
_MEDIAN_STEP = 1e-9  # [rad] and [m] a median that moves less has converged


def rigid(R: NDArray[np.floating], t: NDArray[np.floating]) -> Array:
    """Transform (..., 4, 4) of a rotation (..., 3, 3) and a translation (..., 3)."""
    T = np.zeros((4, 4) if R.ndim == 2 and t.ndim == 1 else (*np.broadcast_shapes(R.shape[:-2], t.shape[:-1]), 4, 4))
    T[..., :3, :3] = R
    T[..., :3, 3] = t
    T[..., 3, 3] = 1.0
    return T


def inverse(T: Array) -> Array:
    """Inverse (..., 4, 4) of rigid transforms."""
    R_transposed = np.swapaxes(T[..., :3, :3], -1, -2)
    return rigid(R_transposed, -(R_transposed @ T[..., :3, 3:])[..., 0])


def transform_points(a_T_b: Array, points_b: NDArray[np.floating]) -> Array:
    """Points (..., N, 3) in frame a of points (..., N, 3) in frame b."""
    points_a: Array = points_b @ np.swapaxes(a_T_b[..., :3, :3], -1, -2) + a_T_b[..., None, :3, 3]
    return points_a


def hat(v: Array) -> Array:
    """Matrix (..., 3, 3) whose product with x is the cross product of v (..., 3) and x."""
    V: Array = (v @ _GENERATORS).reshape(*v.shape, 3)
    return V


def exp_so3(w: Array) -> Array:
    """Rotation (..., 3, 3) of a rotation vector (..., 3) [rad]: Rodrigues' formula."""
    xi = np.zeros((*w.shape[:-1], 6))
    xi[..., :3] = w
    return exp_se3(xi)[..., :3, :3]


def log_so3(R: Array) -> Array:
    """Rotation vector (..., 3) [rad], at most pi long, of a rotation (..., 3, 3)."""
    w: Array = geometry_kernels.log_so3_rows(as_rows(R.reshape(-1, 3, 3)))
    return w.reshape(*R.shape[:-2], 3)


def exp_se3(xi: Array) -> Array:
    """Transform (..., 4, 4) of a tangent vector (..., 6); gtsam's ``Pose3.Expmap``."""
    T: Array = geometry_kernels.exp_se3_rows(as_rows(xi.reshape(-1, 6)))
    return T.reshape(*xi.shape[:-1], 4, 4)


def log_se3(T: Array) -> Array:
    """Tangent vector (..., 6) of a transform (..., 4, 4); gtsam's ``Pose3.Logmap``."""
    xi: Array = geometry_kernels.log_se3_rows(as_rows(T.reshape(-1, 4, 4)))
    return xi.reshape(*T.shape[:-2], 6)


def adjoint(T: Array) -> Array:
    """Ad (..., 6, 6) with ``T @ exp_se3(xi) == exp_se3(Ad @ xi) @ T``; gtsam's ``Pose3.AdjointMap``."""
    R = T[..., :3, :3]
    Ad = np.zeros((*T.shape[:-2], 6, 6))
    Ad[..., :3, :3] = Ad[..., 3:, 3:] = R
    Ad[..., 3:, :3] = hat(T[..., :3, 3]) @ R
    return Ad


def log_jacobian(r: Array) -> Array:
    """J (..., 3, 3): log(exp(-d) exp(r)) is r - J d, for small d (..., 3), of a rotation vector r (..., 3).

    It is the inverse of the left Jacobian (Barfoot 2017, eq. 7.77b); of transforms see ``log_se3_jacobian`` of
    ``geometry_kernels``. With the other sign it is that of the right one: log(exp(r) exp(d)) is r + J(-r) d.
    """
    turn, half = hat(r), 0.5 * np.maximum(np.linalg.norm(r, axis=-1), _SMALL_ANGLE)[..., None, None]
    J: Array = _IDENTITY - 0.5 * turn + (1.0 - half / np.tan(half)) / (4.0 * half**2) * (turn @ turn)
    return J


def nearest_rotation(M: NDArray[np.floating]) -> Array:
    """Rotation (..., 3, 3) closest to a matrix (..., 3, 3) in the Frobenius norm."""
    M = np.asarray(M, dtype=np.float64)
    excess = np.swapaxes(M, -1, -2) @ M - _IDENTITY
    if np.abs(excess).max(initial=0.0) < _NEARLY and (np.linalg.det(M) > 0.0).all():
        # One step of Newton's iteration to the same rotation squares what is left, at a tenth of the cost.
        mended: Array = M - 0.5 * M @ excess
        return mended
    U, _, Vt = np.linalg.svd(M)
    # A reflection is undone along the axis of the smallest singular value, where it costs least.
    U[..., :, 2] *= np.sign(np.linalg.det(U @ Vt))[..., None]
    R: Array = U @ Vt
    return R


def rotation_to_z(direction: Array) -> Array:
    """Rotation (3, 3) that turns a unit direction to z, and the x axis no farther than it must."""
    aside = np.eye(3)[0 if abs(direction[0]) < 0.9 else 1]
    x = aside - (aside @ direction) * direction
    x /= np.linalg.norm(x)
    return np.array([x, np.cross(direction, x), direction])


def shortest_turn(start: Array, end: Array) -> Array:
    """Shortest rotation (..., 3, 3) from directions (..., 3) to others; neither need be unit vectors."""
    a = start / np.linalg.norm(start, axis=-1, keepdims=True)
    b = end / np.linalg.norm(end, axis=-1, keepdims=True)
    axis = np.cross(a, b)
    sine = np.linalg.norm(axis, axis=-1, keepdims=True)
    angle = np.arctan2(sine, np.sum(a * b, axis=-1, keepdims=True))
    turn: Array = exp_so3(axis * (angle / np.maximum(sine, 1e-12)))
    return turn


def rotation_between(start: Array, end: Array, share: float | Array) -> Array:
    """Rotations (..., 3, 3) a share of the way from some to others, about one axis; shares (..., 1) or one."""
    between: Array = start @ exp_so3(share * log_so3(np.swapaxes(start, -1, -2) @ end))
    return between


def quaternion_xyzw(R: Array) -> Array:
    """Unit quaternion (..., 4), x y z w with w >= 0, of a rotation (..., 3, 3)."""
    q: Array = geometry_kernels.quaternion_rows(as_rows(R.reshape(-1, 3, 3)))
    return q.reshape(*R.shape[:-2], 4)


def rotation_from_xyzw(q: NDArray[np.floating]) -> Array:
    """Rotation (..., 3, 3) of a quaternion (..., 4), x y z w, of any length but zero.

    Raises:
        ValueError: a quaternion of length zero, or longer than any number.
    """
    with np.errstate(over="ignore"):
        length = np.linalg.norm(q, axis=-1, keepdims=True)
    if not length.all() or np.isinf(length).any():
        raise ValueError("a quaternion of length zero or infinity is no rotation")
    unit: Array = q.astype(np.float64) / length
    w, V = unit[..., 3, None, None], hat(unit[..., :3])
    R: Array = _IDENTITY + 2.0 * (w * V + V @ V)
    return R


def umeyama(source: NDArray[np.floating], target: NDArray[np.floating], with_scale: bool) -> tuple[float, Array, Array]:
    """Scale s, rotation R (3, 3) and translation t (3,) that minimise the sum of |target - (s R source + t)|^2.

    Umeyama 1991, "Least-squares estimation of transformation parameters between two point patterns".

    Args:
        source: (N, 3) points.
        target: (N, 3) the same points in the other frame.
        with_scale: estimate s too; else it is 1.

    Raises:
        ValueError: fewer than three points, or all on one line: the rotation is not determined.
    """
    if source.shape != target.shape or source.ndim != 2 or len(source) < 3:
        raise ValueError(f"alignment needs two equal lists of 3 points or more, not {source.shape} and {target.shape}")
    source_mean, target_mean = source.mean(axis=0), target.mean(axis=0)
    source_centred, target_centred = source - source_mean, target - target_mean
    U, spread, Vt = np.linalg.svd(target_centred.T @ source_centred / len(source))
    if not spread[1] > _DEGENERATE * spread[0]:
        raise ValueError("alignment needs points that do not all lie on one line")
    signs = np.array([1.0, 1.0, np.sign(np.linalg.det(U @ Vt))])
    R = (U * signs) @ Vt
    scale = float(spread @ signs / np.mean(np.sum(source_centred**2, axis=1))) if with_scale else 1.0
    return scale, R, target_mean - scale * R @ source_mean


def robust_average_pose(poses: Array) -> Array:
    """Average (4, 4) of poses (N, 4, 4) that outliers hardly move: the function f_a of A eq. 6.

    Minimises the sum of angles, and separately the sum of distances, to all poses (Weiszfeld's iteration; on
    rotations as in Hartley, Aftab and Trumpf 2011, "L1 rotation averaging using the Weiszfeld algorithm").

    Raises:
        ValueError: there are no poses.
    """
    if len(poses) == 0:
        raise ValueError("the average of no poses is not defined")
    t = np.median(poses[:, :3, 3], axis=0)
    R = nearest_rotation(poses[:, :3, :3].mean(axis=0))
    for _ in range(_MEDIAN_ITERATIONS):
        rotation_step = _median_step(log_so3(R.T @ poses[:, :3, :3]))
        translation_step = _median_step(poses[:, :3, 3] - t)
        R = R @ exp_so3(rotation_step)
        t = t + translation_step
        if max(np.linalg.norm(rotation_step), np.linalg.norm(translation_step)) < _MEDIAN_STEP:
            break
    return rigid(nearest_rotation(R), t)


def _median_step(offsets: Array) -> Array:
    """One step of Weiszfeld's iteration: the mean of offsets (N, 3), each weighted by one over its length."""
    weights = 1.0 / np.maximum(np.linalg.norm(offsets, axis=1), _MEDIAN_STEP)
    step: Array = weights @ offsets / weights.sum()
    return step
