"""How pixels change with a lens' numbers."""

import numpy as np

from bodycam_ros.camera import CameraModel
from bodycam_ros.geometry import Array

_TINY = 1e-300
_OMEGA_STEP = 1e-6


def by_lens(camera: CameraModel, points_camera: Array) -> Array:
    """Derivatives (N, 2, 4 + D) of the pixels of points (N, 3) by fx, fy, cx, cy and the D coefficients.

    They mean nothing where the lens does not see a point.
    """
    with np.errstate(all="ignore"):
        if camera.distortion_model == "equidistant":
            plane, by_coefficients = _equidistant(camera.distortion, points_camera)
        elif camera.distortion_model == "fov":
            plane, by_coefficients = _fov(camera.distortion[0], points_camera)
        else:
            plane, by_coefficients = _perspective(camera.distortion, points_camera)
    derivatives = np.zeros((len(points_camera), 2, 4 + len(camera.distortion)))
    derivatives[:, 0, 0], derivatives[:, 1, 1] = plane.T
    derivatives[:, 0, 2] = derivatives[:, 1, 3] = 1.0
    derivatives[:, :, 4:] = by_coefficients * np.array([[camera.fx], [camera.fy]])
    return derivatives


def _equidistant(k: tuple[float, ...], points: Array) -> tuple[Array, Array]:
    """Distorted coordinates (N, 2) [focal lengths] and their derivatives (N, 2, 4)."""
    angle, direction = _angle(points)
    powers = angle[:, None] ** np.array([1.0, 3.0, 5.0, 7.0, 9.0])
    return direction * (powers @ np.array([1.0, *k]))[:, None], direction[:, :, None] * powers[:, None, 1:]


def _fov(omega: float, points: Array) -> tuple[Array, Array]:
    angle, direction = _angle(points)

    def radius(w: float) -> Array:
        values: Array = np.arctan2(2.0 * np.tan(0.5 * w) * np.sin(angle), np.cos(angle)) / w
        return values

    w = max(omega, 2.0 * _OMEGA_STEP)
    slope = (radius(w + _OMEGA_STEP) - radius(w - _OMEGA_STEP)) / (2.0 * _OMEGA_STEP)
    return direction * radius(w)[:, None], direction[:, :, None] * slope[:, None, None]


def _perspective(d: tuple[float, ...], points: Array) -> tuple[Array, Array]:
    """plumb_bob (k1, k2, p1, p2, k3), and rational_polynomial, which goes on with k4, k5, k6 of the denominator."""
    k1, k2, p1, p2, k3, *rest = d
    at = points[:, :2] / points[:, 2:]
    x, y = at.T
    r2 = x * x + y * y
    powers = np.stack([r2, r2**2, r2**3], axis=1)
    above, below = 1.0 + powers @ np.array([k1, k2, k3]), 1.0 + powers @ np.array(rest or [0.0, 0.0, 0.0])
    gain = above / below
    plane = at * (gain + 2.0 * p1 * y + 2.0 * p2 * x)[:, None] + np.stack([p2 * r2, p1 * r2], axis=1)
    derivatives = np.empty((len(points), 2, len(d)))
    derivatives[:, :, [0, 1, 4]] = at[:, :, None] * (powers / below[:, None])[:, None]
    derivatives[:, :, 2] = np.stack([2.0 * x * y, r2 + 2.0 * y * y], axis=1)
    derivatives[:, :, 3] = np.stack([r2 + 2.0 * x * x, 2.0 * x * y], axis=1)
    if rest:
        derivatives[:, :, 5:] = -at[:, :, None] * (powers * (gain / below)[:, None])[:, None]
    return plane, derivatives


def _angle(points: Array) -> tuple[Array, Array]:
    """Angles (N,) to the axis, and unit directions (N, 2) from it in the image."""
    from_axis = np.sqrt(points[:, 0] ** 2 + points[:, 1] ** 2 + _TINY)
    return np.arctan2(from_axis, points[:, 2]), points[:, :2] / from_axis[:, None]
