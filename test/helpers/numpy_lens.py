"""The lens models in NumPy, array by array: what the compiled ones are held to."""

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.lens_kernels import (
    COEFFICIENTS,
    EDGE,
    FARTHEST,
    MAX_RADIUS,
    NEAREST,
    PROJECTION,
    REGULAR_ANGLE,
)

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

TINY = 1e-300
STEPS = 20
CONVERGED = 1e-14
ACCEPTED = 1e-11


def is_perspective(camera: CameraModel) -> bool:
    return camera.distortion_model in ("plumb_bob", "rational_polynomial")


def max_radius(camera: CameraModel) -> float:
    return float(camera.parameters[MAX_RADIUS])


def start_table(camera: CameraModel) -> Array:
    """Where the inverse starts: distorted radii, and undistorted ones or angles (2, N)."""
    return camera.parameters[PROJECTION:].reshape(2, -1)


def radius_and_slope(camera: CameraModel, angle: Array) -> tuple[Array, Array]:
    """Distorted radius of a lens that is described by angle, and its derivative."""
    if camera.distortion_model == "fov":
        omega, stretch = camera.parameters[COEFFICIENTS : COEFFICIENTS + 2]
        sin, cos = stretch * np.sin(angle), np.cos(angle)
        return np.arctan2(sin, cos) / omega, stretch / omega / (sin * sin + cos * cos)
    k1, k2, k3, k4 = camera.distortion
    a2 = angle * angle
    slope = 1.0 + a2 * (3.0 * k1 + a2 * (5.0 * k2 + a2 * (7.0 * k3 + a2 * (9.0 * k4))))
    return angle * (1.0 + a2 * (k1 + a2 * (k2 + a2 * (k3 + a2 * k4)))), slope


def gain_and_slope(camera: CameraModel, r2: Array) -> tuple[Array, Array]:
    """Distorted over undistorted radius of a perspective lens, and its derivative by the squared radius."""
    k1, k2, _, _, k3, k4, k5, k6 = (*camera.distortion, 0.0, 0.0, 0.0)[:8]
    denominator = 1.0 + r2 * (k4 + r2 * (k5 + r2 * k6))
    gain = (1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))) / denominator
    numerator_slope = k1 + r2 * (2.0 * k2 + r2 * (3.0 * k3))
    denominator_slope = k4 + r2 * (2.0 * k5 + r2 * (3.0 * k6))
    return gain, (numerator_slope - gain * denominator_slope) / denominator


def project_in_numpy(camera: CameraModel, points: Array) -> tuple[Array, Mask]:
    """Pixels (N, 2) of points (N, 3) in the camera frame, NaN outside of the cone, and which are inside."""
    pixels, _, valid = project_with_jacobian_in_numpy(camera, points)
    return pixels, valid


def project_with_jacobian_in_numpy(camera: CameraModel, points: Array) -> tuple[Array, Array, Mask]:
    """The same, with derivatives (N, 2, 3) of pixels by points."""
    x, y, z = np.asarray(points, np.float64).reshape(-1, 3).T
    jacobian = np.empty((len(x), 2, 3))
    with np.errstate(all="ignore"):
        if is_perspective(camera):
            px, py = x / z, y / z
            *distorted, xx, xy, yy = distort_plane(camera, px, py)
            r2 = px * px + py * py
            valid = (z > NEAREST) & (z < FARTHEST) & (r2 <= max_radius(camera) ** 2 * (1.0 + EDGE))
            jacobian[:, 0] = np.column_stack([xx, xy, -(xx * px + xy * py)]) / z[:, None]
            jacobian[:, 1] = np.column_stack([xy, yy, -(xy * px + yy * py)]) / z[:, None]
        else:
            from_axis_squared = x * x + y * y + TINY
            squared, from_axis = from_axis_squared + z * z, np.sqrt(from_axis_squared)
            angle = np.arctan2(from_axis, z)
            radius, slope = radius_and_slope(camera, angle)
            gain, slope = radius / from_axis, slope / squared
            bend = (slope * z - gain) / from_axis_squared
            jacobian[:, 0] = np.column_stack([gain + bend * x * x, bend * x * y, -slope * x])
            jacobian[:, 1] = np.column_stack([bend * x * y, gain + bend * y * y, -slope * y])
            distorted = [gain * x, gain * y]
            valid = (squared > NEAREST**2) & (squared < FARTHEST**2) & (angle <= camera.max_angle + EDGE)
        pixels = np.column_stack([camera.fx * distorted[0] + camera.cx, camera.fy * distorted[1] + camera.cy])
        jacobian *= np.array([[camera.fx], [camera.fy]])
    pixels[~valid], jacobian[~valid] = np.nan, np.nan
    return pixels, jacobian, valid


def unproject_in_numpy(camera: CameraModel, pixels: Array) -> tuple[Array, Mask]:
    """Unit bearings (N, 3) of pixels (N, 2), NaN where no point of the cone projects to, and which have one."""
    u, v = np.asarray(pixels, np.float64).reshape(-1, 2).T
    x, y = (u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy
    with np.errstate(all="ignore"):
        unproject = perspective_bearings if is_perspective(camera) else angular_bearings
        bearings, valid = unproject(camera, x, y)
    bearings[~valid] = np.nan
    return bearings, valid


def angular_bearings(camera: CameraModel, x: Array, y: Array) -> tuple[Array, Mask]:
    """In closed form, or by Newton from the table: the radius grows strictly with the angle."""
    radius = np.sqrt(x**2 + y**2 + TINY)
    valid = radius <= max_radius(camera) + EDGE
    wanted = np.where(valid, radius, 0.0)
    angle = np.interp(wanted, *start_table(camera))
    is_fov = camera.distortion_model == "fov"
    if is_fov:
        omega, stretch = camera.parameters[COEFFICIENTS : COEFFICIENTS + 2]
        angle = np.arctan2(np.sin(omega * wanted), stretch * np.cos(omega * wanted))
    for _ in range(0 if is_fov else STEPS):
        reached, slope = radius_and_slope(camera, angle)
        if np.max(np.abs(wanted - reached)) < CONVERGED:
            break
        angle = np.clip(angle + (wanted - reached) / slope, 0.0, camera.parameters[REGULAR_ANGLE])
    angle = np.minimum(angle, camera.max_angle)
    gain = np.sin(angle) / radius
    return np.column_stack([gain * x, gain * y, np.cos(angle)]), valid


def perspective_bearings(camera: CameraModel, x_wanted: Array, y_wanted: Array) -> tuple[Array, Mask]:
    """By Newton in the image plane, from the table of the radial distortion alone."""
    finite = np.isfinite(x_wanted) & np.isfinite(y_wanted)
    x_wanted, y_wanted = np.where(finite, x_wanted, 0.0), np.where(finite, y_wanted, 0.0)
    radius = np.hypot(x_wanted, y_wanted)
    start = np.interp(radius, *start_table(camera)) / np.maximum(radius, NEAREST)
    x, y = x_wanted * start, y_wanted * start
    for _ in range(STEPS):
        x_reached, y_reached, xx, xy, yy = distort_plane(camera, x, y)
        x_missing, y_missing = x_wanted - x_reached, y_wanted - y_reached
        missing = np.hypot(x_missing, y_missing) / (1.0 + radius)
        if np.max(missing) < CONVERGED:
            break
        determinant = xx * yy - xy * xy
        x = x + (yy * x_missing - xy * y_missing) / determinant
        y = y + (xx * y_missing - xy * x_missing) / determinant
        back = np.minimum(1.0, max_radius(camera) / np.maximum(np.hypot(x, y), NEAREST))
        x, y = x * back, y * back
    bearings = np.column_stack([x, y, np.ones_like(x)])
    bearings /= np.linalg.norm(bearings, axis=1, keepdims=True)
    return bearings, finite & (missing < ACCEPTED)


def distort_plane(camera: CameraModel, x: Array, y: Array) -> tuple[Array, ...]:
    """Distorted coordinates, and their derivatives: x_d by x, x_d by y (the same as y_d by x), y_d by y."""
    (p1, p2), r2 = camera.distortion[2:4], x * x + y * y
    gain, slope = gain_and_slope(camera, r2)
    along = gain + 2.0 * p1 * y + 2.0 * p2 * x
    return (
        along * x + p2 * r2,
        along * y + p1 * r2,
        along + (2.0 * slope * x + 4.0 * p2) * x,
        2.0 * (slope * x * y + p1 * x + p2 * y),
        along + (2.0 * slope * y + 4.0 * p1) * y,
    )
