"""The lens models as kernels: a point to its pixel, with derivatives, and a pixel to its bearing.

Every kernel takes the lens as a vector, ``CameraModel.parameters``. What is not valid is NaN.

Perspective lenses (``plumb_bob``, ``rational_polynomial``; COLMAP's OPENCV and FULL_OPENCV) distort the image plane at
z = 1. Brown 1966, in OpenCV's form, with r^2 = x^2 + y^2 and tilt = 2 (p1 y + p2 x):
    x_d = (gain(r^2) + tilt) x + p2 r^2,  y_d = (gain(r^2) + tilt) y + p1 r^2
    gain = (1 + k1 r^2 + k2 r^4 + k3 r^6) / (1 + k4 r^2 + k5 r^4 + k6 r^6)
where the denominator is Claus and Fitzgibbon's 2005, "A rational function lens distortion model for general cameras".

The others distort the angle a to the axis, and have no pole at 90 degrees. ``equidistant`` (``cv2.fisheye``, COLMAP's
OPENCV_FISHEYE) is Kannala and Brandt's 2006 with the four odd terms that OpenCV kept:
    r_d = a (1 + k1 a^2 + k2 a^4 + k3 a^6 + k4 a^8)
``fov`` (COLMAP's FOV) is Devernay and Faugeras' 2001, "Straight lines have to be straight":
    r_d = atan(2 tan(a) tan(omega / 2)) / omega
continued beyond 90 degrees by ``atan2``, where COLMAP ends; omega = 0 is the pinhole.
"""

import math

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.kernels import kernel

NEAREST = 1e-9
"""A point closer to the projection centre has no direction [m]."""

FARTHEST = 1e100
"""Beyond it squares overflow [m]."""

EDGE = 1e-9
"""Rounding of an angle [rad] or radius allowed at the cone's edge: what was unprojected projects again."""


Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

PERSPECTIVE = 0.0
EQUIDISTANT = 1.0
FOV = 2.0
_MODEL, _WIDTH, _HEIGHT, _FX, _FY, _CX, _CY, MAX_ANGLE, MAX_RADIUS, REGULAR_ANGLE = range(10)
COEFFICIENTS = 10
"""First entry of the distortion coefficients."""
PROJECTION = 18
"""Entries of a lens that projecting takes: kernels that do no more may be given these alone."""
# Then distorted radii, and what has them: undistorted radii of a perspective lens, angles of an equidistant one.
_TABLE = PROJECTION

_DIRECTIONS = 24  # in which the derivative of a perspective lens is tried
_TINY = 1e-300
_MAX_STEPS = 20
_CONVERGED = 1e-14
_ACCEPTED = 1e-11


@kernel("(f8[::1], f8[::1])")
def measure_shape(lens: Array, angles: Array) -> tuple[Array, Mask]:
    """Distorted radii (N,) [focal lengths] at angles (N,) to the axis [rad], without tangential distortion.

    And whether the lens can be inverted there (N,): in every direction about the axis the image grows outwards.
    """
    radii, regular = np.empty(len(angles)), np.empty(len(angles), np.bool_)
    for i in range(len(angles)):
        if lens[_MODEL] == PERSPECTIVE:
            radius = math.tan(angles[i])
            gain = _gain(lens, radius * radius)
            radii[i], regular[i] = gain * radius, gain > 0.0
            for k in range(_DIRECTIONS):
                turn = 2.0 * math.pi * k / _DIRECTIONS
                _, _, xx, xy, yy = _distort_plane(lens, radius * math.cos(turn), radius * math.sin(turn))
                regular[i] &= xx * yy - xy * xy > 0.0
        else:
            radii[i], slope = _radius_and_slope(lens, angles[i])
            regular[i] = slope > 0.0 and radii[i] >= 0.0
    return radii, regular


@kernel("(f8[::1], f8[:, ::1])")
def project_points(lens: Array, points: Array) -> tuple[Array, Mask]:
    """Pixels (N, 2) of points (N, 3) [m] in the camera frame, and which of them are valid (N,)."""
    pixels = np.empty((len(points), 2))
    valid = np.empty(len(points), np.bool_)
    for i in range(len(points)):
        pixels[i, 0], pixels[i, 1], valid[i] = project_point(lens, points[i, 0], points[i, 1], points[i, 2])
    return pixels, valid


@kernel("(f8[::1], f8[:, ::1])")
def project_points_with_jacobian(lens: Array, points: Array) -> tuple[Array, Array, Mask]:
    """Pixels (N, 2), their derivatives (N, 2, 3) [px/m] by the points (N, 3), and validity (N,)."""
    pixels = np.empty((len(points), 2))
    jacobian = np.empty((len(points), 2, 3))
    valid = np.empty(len(points), np.bool_)
    for i in range(len(points)):
        u, v, valid[i], u_x, u_y, u_z, v_x, v_y, v_z = project_point_with_jacobian(
            lens, points[i, 0], points[i, 1], points[i, 2]
        )
        pixels[i, 0], pixels[i, 1] = u, v
        jacobian[i, 0, 0], jacobian[i, 0, 1], jacobian[i, 0, 2] = u_x, u_y, u_z
        jacobian[i, 1, 0], jacobian[i, 1, 1], jacobian[i, 1, 2] = v_x, v_y, v_z
    return pixels, jacobian, valid


@kernel("(f8[::1], f8[:, ::1])")
def unproject_pixels(lens: Array, pixels: Array) -> tuple[Array, Mask]:
    """Unit bearings (N, 3) in the camera frame of pixels (N, 2), and which of them are valid (N,)."""
    bearings = np.empty((len(pixels), 3))
    valid = np.empty(len(pixels), np.bool_)
    for i in range(len(pixels)):
        x, y, z, valid[i] = unproject_pixel(lens, pixels[i, 0], pixels[i, 1])
        bearings[i, 0], bearings[i, 1], bearings[i, 2] = x, y, z
    return bearings, valid


@kernel()
def project_point(lens: Array, x: float, y: float, z: float) -> tuple[float, float, bool]:
    """Pixel (u, v) of a point [m] in the camera frame, and whether it is valid."""
    if lens[_MODEL] == PERSPECTIVE:
        px, py = x / z, y / z
        r2 = px * px + py * py
        gain = _gain(lens, r2) + 2.0 * lens[COEFFICIENTS + 2] * py + 2.0 * lens[COEFFICIENTS + 3] * px
        x_distorted = gain * px + lens[COEFFICIENTS + 3] * r2
        y_distorted = gain * py + lens[COEFFICIENTS + 2] * r2
        valid = _in_perspective_cone(lens, r2, z)
    else:
        from_axis_squared = x * x + y * y + _TINY
        from_axis = math.sqrt(from_axis_squared)
        angle = math.atan2(from_axis, z)
        gain = _radius_and_slope(lens, angle)[0] / from_axis
        x_distorted, y_distorted = gain * x, gain * y
        valid = _in_angular_cone(lens, angle, from_axis_squared + z * z)
    if not valid:
        return math.nan, math.nan, False
    return lens[_FX] * x_distorted + lens[_CX], lens[_FY] * y_distorted + lens[_CY], True


@kernel()
def project_point_with_jacobian(
    lens: Array, x: float, y: float, z: float
) -> tuple[float, float, bool, float, float, float, float, float, float]:
    """Project as ``project_point`` does; return also the derivatives [px/m] of u by x, y and z, and those of v."""
    fx, fy = lens[_FX], lens[_FY]
    if lens[_MODEL] == PERSPECTIVE:
        px, py = x / z, y / z
        x_distorted, y_distorted, xx, xy, yy = _distort_plane(lens, px, py)
        xx, xy, yy = xx / z, xy / z, yy / z
        x_z, y_z = -(xx * px + xy * py), -(xy * px + yy * py)
        valid = _in_perspective_cone(lens, px * px + py * py, z)
    else:
        from_axis_squared = x * x + y * y + _TINY
        squared_distance = from_axis_squared + z * z
        from_axis = math.sqrt(from_axis_squared)
        angle = math.atan2(from_axis, z)
        radius, slope = _radius_and_slope(lens, angle)
        gain = radius / from_axis
        slope /= squared_distance
        bend = (slope * z - gain) / from_axis_squared
        x_distorted, y_distorted = gain * x, gain * y
        xx = gain + bend * (x * x)
        xy = bend * x * y
        yy = gain + bend * (y * y)
        x_z, y_z = -slope * x, -slope * y
        valid = _in_angular_cone(lens, angle, squared_distance)
    if not valid:
        nan = math.nan
        return nan, nan, False, nan, nan, nan, nan, nan, nan
    u, v = fx * x_distorted + lens[_CX], fy * y_distorted + lens[_CY]
    return u, v, True, fx * xx, fx * xy, fx * x_z, fy * xy, fy * yy, fy * y_z


@kernel()
def unproject_pixel(lens: Array, u: float, v: float) -> tuple[float, float, float, bool]:
    """Unit bearing (x, y, z) in the camera frame of a pixel, and whether it is valid."""
    x_distorted, y_distorted = (u - lens[_CX]) / lens[_FX], (v - lens[_CY]) / lens[_FY]
    if lens[_MODEL] == PERSPECTIVE:
        return _undistort_perspective(lens, x_distorted, y_distorted)
    radius = math.sqrt(x_distorted**2 + y_distorted**2 + _TINY)
    if not radius <= lens[MAX_RADIUS] + EDGE:
        return math.nan, math.nan, math.nan, False
    angle = min(_angle(lens, radius), lens[MAX_ANGLE])
    gain = math.sin(angle) / radius
    return gain * x_distorted, gain * y_distorted, math.cos(angle), True


@kernel()
def in_image(lens: Array, u: float, v: float) -> bool:
    """Whether the sensor covers a pixel, to the outer borders of its outermost pixels; NaN is outside."""
    return u >= -0.5 and u <= lens[_WIDTH] - 0.5 and v >= -0.5 and v <= lens[_HEIGHT] - 0.5


@kernel()
def _in_perspective_cone(lens: Array, r2: float, z: float) -> bool:
    return z > NEAREST and z < FARTHEST and r2 <= lens[MAX_RADIUS] ** 2 * (1.0 + EDGE)


@kernel()
def _in_angular_cone(lens: Array, angle: float, squared_distance: float) -> bool:
    has_direction = squared_distance > NEAREST**2 and squared_distance < FARTHEST**2
    return has_direction and angle <= lens[MAX_ANGLE] + EDGE


@kernel()
def _gain(lens: Array, r2: float) -> float:
    """Gain of the rational polynomial, which with k4 = k5 = k6 = 0 is plumb_bob."""
    k1, k2, k3 = lens[COEFFICIENTS], lens[COEFFICIENTS + 1], lens[COEFFICIENTS + 4]
    k4, k5, k6 = lens[COEFFICIENTS + 5], lens[COEFFICIENTS + 6], lens[COEFFICIENTS + 7]
    gain: float = (1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1.0 + r2 * (k4 + r2 * (k5 + r2 * k6)))
    return gain


@kernel()
def _distort_plane(lens: Array, x: float, y: float) -> tuple[float, float, float, float, float]:
    k1, k2, k3 = lens[COEFFICIENTS], lens[COEFFICIENTS + 1], lens[COEFFICIENTS + 4]
    p1, p2 = lens[COEFFICIENTS + 2], lens[COEFFICIENTS + 3]
    k4, k5, k6 = lens[COEFFICIENTS + 5], lens[COEFFICIENTS + 6], lens[COEFFICIENTS + 7]
    r2 = x * x + y * y
    denominator = 1.0 + r2 * (k4 + r2 * (k5 + r2 * k6))
    gain = (1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))) / denominator
    numerator_slope = k1 + r2 * (2.0 * k2 + r2 * (3.0 * k3))
    denominator_slope = k4 + r2 * (2.0 * k5 + r2 * (3.0 * k6))
    slope = 2.0 * ((numerator_slope - gain * denominator_slope) / denominator)
    slope_x = slope * x
    gain += 2.0 * p1 * y + 2.0 * p2 * x
    return (
        gain * x + p2 * r2,
        gain * y + p1 * r2,
        gain + (slope_x + 4.0 * p2) * x,
        slope_x * y + 2.0 * p1 * x + 2.0 * p2 * y,
        gain + (slope * y + 4.0 * p1) * y,
    )


@kernel()
def _undistort_perspective(lens: Array, x_wanted: float, y_wanted: float) -> tuple[float, float, float, bool]:
    if not (math.isfinite(x_wanted) and math.isfinite(y_wanted)):
        return math.nan, math.nan, math.nan, False
    radius = math.hypot(x_wanted, y_wanted)
    scale = 1.0 + radius
    start = _in_table(lens, radius) / max(radius, NEAREST)
    x, y = x_wanted * start, y_wanted * start
    missing = math.inf
    for _ in range(_MAX_STEPS):
        x_reached, y_reached, xx, xy, yy = _distort_plane(lens, x, y)
        x_missing, y_missing = x_wanted - x_reached, y_wanted - y_reached
        missing = math.hypot(x_missing, y_missing) / scale
        if missing < _CONVERGED:
            break
        determinant = xx * yy - xy * xy
        x = x + (yy * x_missing - xy * y_missing) / determinant
        y = y + (xx * y_missing - xy * x_missing) / determinant
        back_into_cone = min(1.0, lens[MAX_RADIUS] / max(math.hypot(x, y), NEAREST))
        x, y = x * back_into_cone, y * back_into_cone
    if not missing < _ACCEPTED:
        return math.nan, math.nan, math.nan, False
    length = math.sqrt(x * x + y * y + 1.0)
    return x / length, y / length, 1.0 / length, True


@kernel()
def _radius_and_slope(lens: Array, angle: float) -> tuple[float, float]:
    if lens[_MODEL] == FOV:
        omega, stretch = lens[COEFFICIENTS], lens[COEFFICIENTS + 1]
        sin, cos = stretch * math.sin(angle), math.cos(angle)
        return math.atan2(sin, cos) / omega, stretch / omega / (sin * sin + cos * cos)
    k1, k2 = lens[COEFFICIENTS], lens[COEFFICIENTS + 1]
    k3, k4 = lens[COEFFICIENTS + 2], lens[COEFFICIENTS + 3]
    a2 = angle * angle
    slope = 1.0 + a2 * (3.0 * k1 + a2 * (5.0 * k2 + a2 * (7.0 * k3 + a2 * (9.0 * k4))))
    return angle * (1.0 + a2 * (k1 + a2 * (k2 + a2 * (k3 + a2 * k4)))), slope


@kernel()
def _angle(lens: Array, radius: float) -> float:
    if lens[_MODEL] == FOV:
        omega, stretch = lens[COEFFICIENTS], lens[COEFFICIENTS + 1]
        phase = omega * radius
        return math.atan2(math.sin(phase), stretch * math.cos(phase))
    angle: float = _in_table(lens, radius)
    for _ in range(_MAX_STEPS):
        reached, slope = _radius_and_slope(lens, angle)
        missing = radius - reached
        if abs(missing) < _CONVERGED:
            break
        angle = min(max(angle + missing / slope, 0.0), lens[REGULAR_ANGLE])
    return angle


@kernel()
def _in_table(lens: Array, radius: float) -> float:
    """What has a distorted radius, by linear interpolation."""
    count = (len(lens) - _TABLE) // 2
    radii, values = lens[_TABLE : _TABLE + count], lens[_TABLE + count :]
    low, high = 0, count - 1
    radius = min(radius, radii[high])
    while high - low > 1:
        middle = (low + high) // 2
        if radii[middle] <= radius:
            low = middle
        else:
            high = middle
    value: float = values[low] + (values[high] - values[low]) / (radii[high] - radii[low]) * (radius - radii[low])
    return value
