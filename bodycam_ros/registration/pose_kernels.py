"""The robust Gauss-Newton iteration of ``pose_fit``, and its normal equations for a whole recording.

Its unknowns are the pose (6) and, where rows are read out one by one, the bend of the motion (6), the difference of the
twist from its prediction [rad/s, m/s], and the read-out time (1).
"""

import math

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera.lens_kernels import project_point, project_point_with_jacobian
from bodycam_ros.camera.readout import LONGEST_READOUT_S
from bodycam_ros.geometry_kernels import compose, exp_se3, inverse, log_se3, solve_positive
from bodycam_ros.kernels import kernel

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

_CONVERGED = 1e-4
"""A step below this [rad, m] moves landmarks by some hundredths of a pixel; the next one would be far smaller yet."""

_FIXED_READOUT = 1e-7
"""Standard deviation of a read-out time that is given [s]."""

_LONGEST_STEP = 0.5  # [rad, m]
_DAMPING = 1e-9
_LEAST = 1e-9

# The camera's motion as a vector.
_READOUT_TIME = 0
_READOUT_SIGMA = 1
_GAIN = 2
_TWIST = 8
_SIGMAS = 14


@kernel("(f8[::1], f8[:, ::1], f8[:, ::1], f8[:, ::1], f8, f8, f8, i8, f8[::1], f8[::1], f8[:, ::1])")
def fit_kernel(
    lens: Array,
    points_world: Array,
    pixels: Array,
    world_T_start: Array,
    pixel_sigma: float,
    inlier_px: float,
    start_px: float,
    iterations: int,
    shares: Array,
    motion: Array,
    world_T_previous: Array,
) -> tuple[Array, Array, Array, Mask, Array, float, float]:
    """Fit a pose to landmarks.

    Args:
        lens: ``CameraModel.parameters``.
        points_world: (N, 3) [m].
        pixels: (N, 2).
        world_T_start: (4, 4) initial pose.
        pixel_sigma, inlier_px, start_px, iterations: of ``fit_pose``.
        shares: (N,) place of the pixels' rows in the read-out, ``row_shares``.
        motion: (20,) read-out time and its sigma, gain, twist and sigmas of ``ImageMotion``; empty where all rows are
            exposed together.
        world_T_previous: (4, 4) of ``ImageMotion``.

    Returns:
        The fields of ``PoseFit``, in their order.
    """
    count, unknowns = len(pixels), 13 if len(motion) else 6
    errors_px = np.empty(count)
    hessian, gradient = np.empty((unknowns, unknowns)), np.empty(unknowns)
    pose = world_T_start
    bend = np.zeros(6)
    readout_time = motion[_READOUT_TIME] if len(motion) else 0.0
    stiffness = _stiffness(motion, pixel_sigma)
    twist = _twist(pose, bend, motion, world_T_previous)
    _linearise(
        lens, points_world, pixels, pose, twist, readout_time, shares, motion, start_px, errors_px, hessian, gradient
    )
    # The right landmarks lie within twice the median error.
    scale_px = min(max(2.0 * np.median(errors_px) if count else start_px, inlier_px), start_px)
    for iteration in range(iterations + 1):
        last = iteration == iterations
        twist = _twist(pose, bend, motion, world_T_previous)
        if last:
            scale_px = inlier_px
        elif iteration > 0:
            scale_px = max(0.5 * scale_px, inlier_px)
        _linearise(
            lens,
            points_world,
            pixels,
            pose,
            twist,
            readout_time,
            shares,
            motion,
            scale_px,
            errors_px,
            hessian,
            gradient,
        )
        pull = gradient[unknowns - 1]
        if len(motion):
            for i in range(7):
                hessian[6 + i, 6 + i] += stiffness[i]
                gradient[6 + i] += stiffness[i] * (bend[i] if i < 6 else readout_time - motion[_READOUT_TIME])
        readout_before = readout_time
        if last:
            break
        step, found = _gauss_newton_step(hessian, gradient)
        if not found:
            break
        largest, step_of_pose = 0.0, np.empty(6)
        for k in range(6):
            largest = max(largest, abs(step[k]))
            step_of_pose[k] = min(max(step[k], -_LONGEST_STEP), _LONGEST_STEP)
        pose = compose(pose, exp_se3(step_of_pose))
        if len(motion):
            bend = bend.copy()
            for k in range(6):
                bend[k] += step[6 + k]
            readout_time = min(max(readout_time + step[12], -LONGEST_READOUT_S), LONGEST_READOUT_S)
        if scale_px <= inlier_px and largest < _CONVERGED:
            break
    inliers = errors_px < inlier_px
    variance = pixel_sigma**2
    shifts = np.zeros((count, 2))
    readout, readout_information = 0.0, 0.0
    if len(motion):
        twist = _twist(pose, bend, motion, world_T_previous)
        _measure_shifts(lens, points_world, pose, twist, readout_time, shares, shifts)
        if motion[_READOUT_SIGMA] != 0.0 and np.isfinite(errors_px).any():
            readout, readout_information = _readout(hessian, gradient, stiffness[6], pull, readout_before)
    information = _pose_hessian(hessian) / variance
    return pose, information, errors_px, inliers, shifts, readout, readout_information / variance


@kernel("(f8[::1], f8[:, ::1], f8[:, ::1], i8[::1], f8[:, :, ::1], f8)")
def linearise_images(
    lens: Array,
    points_world: Array,
    pixels: Array,
    first: NDArray[np.int64],
    world_T_image: Array,
    inlier_px: float,
) -> tuple[Array, Array]:
    """Normal equations of a camera's images, each at its own pose.

    Args:
        lens: ``CameraModel.parameters``.
        points_world, pixels: (N, 3) landmarks [m] and (N, 2) their places, those of one image after the other.
        first: (T + 1,) where those of each image begin, and N.
        world_T_image: (T, 4, 4) poses.
        inlier_px: scale of the robust kernel.

    Returns:
        (T, 6, 6) and (T, 6) second and first derivative of half the robust squared errors [px^2] by the poses.
    """
    count, nothing = len(world_T_image), np.zeros(0)
    hessians, gradients = np.empty((count, 6, 6)), np.empty((count, 6))
    for t in range(count):
        own = slice(first[t], first[t + 1])
        _linearise(
            lens,
            points_world[own],
            pixels[own],
            world_T_image[t],
            np.zeros(6),
            0.0,
            nothing,
            nothing,
            inlier_px,
            np.empty(first[t + 1] - first[t]),
            hessians[t],
            gradients[t],
        )
    return hessians, gradients


@kernel()
def _linearise(
    lens: Array,
    points_world: Array,
    pixels: Array,
    pose: Array,
    twist: Array,
    readout_time: float,
    shares: Array,
    motion: Array,
    scale_px: float,
    errors_px: Array,
    hessian: Array,
    gradient: Array,
) -> None:
    """Reprojection errors (A eq. 9) and their normal equations, under the kernel of Geman and McClure.

    A landmark out of view is infinitely far off and takes no part.
    """
    unknowns = len(gradient)
    by_u = np.empty(len(gradient))
    by_v = np.empty(len(gradient))
    hessian[:], gradient[:] = 0.0, 0.0
    for i in range(len(pixels)):
        x, y, z = _in_camera(pose, points_world, i)
        time_s = 0.0
        if len(motion):
            time_s = readout_time * shares[i]
            x, y, z = _move_point(x, y, z, twist, time_s)
        u, v, valid, u_x, u_y, u_z, v_x, v_y, v_z = project_point_with_jacobian(lens, x, y, z)
        if not valid:
            errors_px[i] = math.inf
            continue
        u, v = u - pixels[i, 0], v - pixels[i, 1]
        errors_px[i] = math.sqrt(u * u + v * v)
        # The point moves by hat(p) w - v.
        by_u[0], by_u[1], by_u[2] = u_y * z - u_z * y, u_z * x - u_x * z, u_x * y - u_y * x
        by_v[0], by_v[1], by_v[2] = v_y * z - v_z * y, v_z * x - v_x * z, v_x * y - v_y * x
        by_u[3], by_u[4], by_u[5] = -u_x, -u_y, -u_z
        by_v[3], by_v[4], by_v[5] = -v_x, -v_y, -v_z
        if len(motion):
            # A row's own pose is that of the middle row, moved on by the twist, which depends on the pose.
            by_u[12], by_v[12] = 0.0, 0.0
            for k in range(6):
                by_u[12] += shares[i] * by_u[k] * twist[k]
                by_v[12] += shares[i] * by_v[k] * twist[k]
                by_u[6 + k], by_v[6 + k] = time_s * by_u[k], time_s * by_v[k]
                by_u[k] *= 1.0 + motion[_GAIN + k] * time_s
                by_v[k] *= 1.0 + motion[_GAIN + k] * time_s
        weight = 1.0 / (1.0 + (errors_px[i] / scale_px) ** 2) ** 2
        for j in range(unknowns):
            weighted_u, weighted_v = weight * by_u[j], weight * by_v[j]
            gradient[j] += weighted_u * u + weighted_v * v
            for k in range(j + 1):
                hessian[j, k] += weighted_u * by_u[k] + weighted_v * by_v[k]
    for j in range(unknowns):
        for k in range(j):
            hessian[k, j] = hessian[j, k]


@kernel()
def _stiffness(motion: Array, pixel_sigma: float) -> Array:
    """Weights (7,) of the priors of bend and read-out time, in squared pixels; 0 where rows are exposed together."""
    stiffness = np.zeros(7)
    if not len(motion):
        return stiffness
    for i in range(6):
        stiffness[i] = (pixel_sigma / motion[_SIGMAS + i]) ** 2
    stiffness[6] = (pixel_sigma / max(motion[_READOUT_SIGMA], _FIXED_READOUT)) ** 2
    return stiffness


@kernel()
def _twist(pose: Array, bend: Array, motion: Array, world_T_previous: Array) -> Array:
    """Twist (6,) [rad/s, m/s] at a pose; zero where all rows are exposed together."""
    twist = np.zeros(6)
    if len(motion):
        since = log_se3(compose(inverse(world_T_previous), pose))
        for k in range(6):
            twist[k] = motion[_GAIN + k] * since[k] + motion[_TWIST + k] + bend[k]
    return twist


@kernel()
def twist_at(pose: Array, motion: Array, world_T_previous: Array) -> Array:
    """Twist (6,) [rad/s, m/s] at a pose as it is predicted; zero where all rows are exposed together."""
    return _twist(pose, np.zeros(6), motion, world_T_previous)


@kernel()
def _in_camera(pose: Array, points_world: Array, i: int) -> tuple[float, float, float]:
    x, y, z = points_world[i, 0] - pose[0, 3], points_world[i, 1] - pose[1, 3], points_world[i, 2] - pose[2, 3]
    return (
        pose[0, 0] * x + pose[1, 0] * y + pose[2, 0] * z,
        pose[0, 1] * x + pose[1, 1] * y + pose[2, 1] * z,
        pose[0, 2] * x + pose[1, 2] * y + pose[2, 2] * z,
    )


@kernel()
def _move_point(x: float, y: float, z: float, twist: Array, time_s: float) -> tuple[float, float, float]:
    """A point of the camera's frame after a time [s] of the camera's twist.

    The exponential's series up to its second term: 10 rad/s over 6 ms leave 0.01 px.
    """
    a, b, c = twist[0], twist[1], twist[2]
    moved_x = time_s * (y * c - z * b - twist[3])
    moved_y = time_s * (z * a - x * c - twist[4])
    moved_z = time_s * (x * b - y * a - twist[5])
    return (
        x + moved_x + 0.5 * time_s * (moved_y * c - moved_z * b),
        y + moved_y + 0.5 * time_s * (moved_z * a - moved_x * c),
        z + moved_z + 0.5 * time_s * (moved_x * b - moved_y * a),
    )


@kernel()
def _gauss_newton_step(hessian: Array, gradient: Array) -> tuple[Array, bool]:
    damped, of_pose = hessian.copy(), 0.0
    for i in range(6):
        of_pose += hessian[i, i]
    for i in range(len(gradient)):
        damped[i, i] += _DAMPING * max(hessian[i, i], of_pose, _LEAST)
    step, found = solve_positive(damped, gradient)
    return -step, found


@kernel()
def _pose_hessian(hessian: Array) -> Array:
    """(6, 6) of the pose, the rest marginalised."""
    of_pose = hessian[:6, :6].copy()
    if len(hessian) > 6:
        for j in range(6):
            solved, _ = solve_positive(hessian[6:, 6:], hessian[6:, j])
            for i in range(6):
                for k in range(7):
                    of_pose[i, j] -= hessian[i, 6 + k] * solved[k]
    return of_pose


@kernel()
def _readout(
    hessian: Array, gradient: Array, stiffness: float, pull: float, readout_time: float
) -> tuple[float, float]:
    """The image's estimate of the read-out time [s], and its information [px^2/s^2], all else free."""
    by_time, found = solve_positive(hessian[:12, :12], hessian[:12, 12])
    rest, _ = solve_positive(hessian[:12, :12], gradient[:12])
    if not found:
        return 0.0, 0.0
    information = hessian[12, 12] - stiffness
    for k in range(12):
        information -= hessian[12, k] * by_time[k]
        pull -= hessian[12, k] * rest[k]
    if information <= 0.0:
        return 0.0, 0.0
    return readout_time - pull / information, information


@kernel()
def _measure_shifts(
    lens: Array, points_world: Array, pose: Array, twist: Array, readout_time: float, shares: Array, shifts: Array
) -> None:
    """How far (N, 2) the read-out of the rows moves the landmarks in the image [px]."""
    for i in range(len(points_world)):
        x, y, z = _in_camera(pose, points_world, i)
        u, v, valid = project_point(lens, x, y, z)
        x, y, z = _move_point(x, y, z, twist, readout_time * shares[i])
        u_moved, v_moved, valid_moved = project_point(lens, x, y, z)
        if valid and valid_moved:
            shifts[i, 0], shifts[i, 1] = u_moved - u, v_moved - v
