"""Lenses described in the perspective image: radial and tangential distortion of (x/z, y/z).

Brown 1966, in OpenCV's form: with r^2 = x^2 + y^2 in the image plane at z = 1,
    x_d = gain(r^2) x + 2 p1 x y + p2 (r^2 + 2 x^2) = (gain(r^2) + tilt) x + p2 r^2
    y_d = gain(r^2) y + p1 (r^2 + 2 y^2) + 2 p2 x y = (gain(r^2) + tilt) y + p1 r^2,  tilt = 2 (p1 y + p2 x)
The valid cone ends short of 90 degrees, or where the distortion can no longer be inverted: a pole of the gain, or a
vanishing determinant of its derivative in any direction about the axis.
"""

from abc import abstractmethod

import numpy as np

from bodycam_ros.camera.lens_kernels import EDGE, FARTHEST, NEAREST, PERSPECTIVE, lens_vector
from bodycam_ros.camera.model import Array, CameraModel, Mask, largest_regular_angle

_WIDEST = np.pi / 2.0 - 1e-6  # [rad]
_DIRECTIONS = 24  # in which the determinant is tried
_START_SAMPLES = 1000  # angles of the table that the inverse starts from
_MAX_STEPS = 20  # two or three are enough but at the very edge of the cone, where the determinant vanishes
_CONVERGED = 1e-14  # of the distorted coordinates, relative where they exceed one focal length
_ACCEPTED = 1e-11


class PerspectiveCamera(CameraModel):
    """A camera with a radial ``_gain`` and the tangential coefficients p1 and p2.

    Attributes:
        max_radius: the undistorted radius at ``max_angle`` [focal lengths].
        start_table: distorted radii, ascending, and the undistorted ones that have them without tangential terms: where
            the inverse starts.
    """

    def __init__(
        self,
        name: str,
        width: int,
        height: int,
        fx: float,
        fy: float,
        cx: float,
        cy: float,
        distortion: tuple[float, ...],
    ) -> None:
        super().__init__(name, width, height, fx, fy, cx, cy, distortion)
        self._p1, self._p2 = distortion[2:4]
        self.max_angle = largest_regular_angle(self._is_regular, _WIDEST)
        self.max_radius = float(np.tan(self.max_angle))
        radii = np.tan(np.linspace(0.0, self.max_angle, _START_SAMPLES))
        self.start_table = radii * self._gain(radii * radii), radii

    @abstractmethod
    def _gain(self, r2: Array) -> Array:
        """Distorted over undistorted radius, without tangential terms, at the squared undistorted radius."""

    @abstractmethod
    def _gain_and_slope(self, r2: Array) -> tuple[Array, Array]:
        """Gain and its derivative by the squared radius."""

    def _parameters(self) -> Array:
        return lens_vector(PERSPECTIVE, self.pinhole, self.max_radius, 0.0, self.distortion, *self.start_table)

    def _distort(self, x: Array, y: Array, z: Array) -> tuple[Array, Array, Mask]:
        px, py = x / z, y / z
        r2 = px * px + py * py
        gain = self._gain(r2) + 2.0 * self._p1 * py + 2.0 * self._p2 * px
        return gain * px + self._p2 * r2, gain * py + self._p1 * r2, self._in_cone(r2, z)

    def _distort_with_jacobian(self, x: Array, y: Array, z: Array, jacobian: Array) -> tuple[Array, Array, Mask]:
        px, py = x / z, y / z
        x_distorted, y_distorted, xx, xy, yy = self._distort_plane(px, py)
        jacobian[:, 0, 0] = xx = xx / z
        jacobian[:, 0, 1] = jacobian[:, 1, 0] = xy = xy / z
        jacobian[:, 1, 1] = yy = yy / z
        jacobian[:, 0, 2] = -(xx * px + xy * py)
        jacobian[:, 1, 2] = -(xy * px + yy * py)
        return x_distorted, y_distorted, self._in_cone(px * px + py * py, z)

    def _undistort(self, x_distorted: Array, y_distorted: Array) -> tuple[Array, Mask]:
        """Newton in the image plane from a table of the radial distortion alone."""
        finite = np.isfinite(x_distorted) & np.isfinite(y_distorted)
        x_wanted, y_wanted = np.where(finite, x_distorted, 0.0), np.where(finite, y_distorted, 0.0)
        radius = np.hypot(x_wanted, y_wanted)
        scale = 1.0 + radius
        start = np.interp(radius, *self.start_table) / np.maximum(radius, NEAREST)
        x, y = x_wanted * start, y_wanted * start
        for _ in range(_MAX_STEPS):
            x_reached, y_reached, xx, xy, yy = self._distort_plane(x, y)
            x_missing, y_missing = x_wanted - x_reached, y_wanted - y_reached
            missing = np.hypot(x_missing, y_missing) / scale
            if np.max(missing, initial=0.0) < _CONVERGED:
                break
            determinant = xx * yy - xy * xy
            x = x + (yy * x_missing - xy * y_missing) / determinant
            y = y + (xx * y_missing - xy * x_missing) / determinant
            back_into_cone = np.minimum(1.0, self.max_radius / np.maximum(np.hypot(x, y), NEAREST))
            x, y = x * back_into_cone, y * back_into_cone
        bearings = np.column_stack([x, y, np.ones_like(x)])
        bearings /= np.linalg.norm(bearings, axis=1, keepdims=True)
        return bearings, finite & (missing < _ACCEPTED)

    def _distort_plane(self, x: Array, y: Array) -> tuple[Array, Array, Array, Array, Array]:
        """Distorted coordinates, and their derivatives: x_d by x, x_d by y (the same as y_d by x), y_d by y."""
        p1, p2 = self._p1, self._p2
        r2 = x * x + y * y
        gain, slope = self._gain_and_slope(r2)
        slope *= 2.0
        slope_x = slope * x
        gain += 2.0 * p1 * y + 2.0 * p2 * x
        return (
            gain * x + p2 * r2,
            gain * y + p1 * r2,
            gain + (slope_x + 4.0 * p2) * x,
            slope_x * y + 2.0 * p1 * x + 2.0 * p2 * y,
            gain + (slope * y + 4.0 * p1) * y,
        )

    def _is_regular(self, angle: Array) -> Mask:
        direction = np.linspace(0.0, 2.0 * np.pi, _DIRECTIONS, endpoint=False)[:, None]
        radius = np.tan(angle)
        _, _, xx, xy, yy = self._distort_plane(radius * np.cos(direction), radius * np.sin(direction))
        regular: Mask = (xx * yy - xy * xy > 0.0).all(axis=0) & (self._gain(radius * radius) > 0.0)
        return regular

    def _in_cone(self, r2: Array, z: Array) -> Mask:
        return (z > NEAREST) & (z < FARTHEST) & (r2 <= self.max_radius**2 * (1.0 + EDGE))


class PlumbBobCamera(PerspectiveCamera):
    """The ordinary lens of ROS and OpenCV; COLMAP's OPENCV if k3 = 0. gain = 1 + k1 r^2 + k2 r^4 + k3 r^6."""

    distortion_model = "plumb_bob"
    coefficients = ("k1", "k2", "p1", "p2", "k3")

    def _gain(self, r2: Array) -> Array:
        k1, k2, _, _, k3 = self.distortion
        return 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))

    def _gain_and_slope(self, r2: Array) -> tuple[Array, Array]:
        k1, k2, _, _, k3 = self.distortion
        return 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3)), k1 + r2 * (2.0 * k2 + r2 * (3.0 * k3))


class RationalPolynomialCamera(PerspectiveCamera):
    """The rational lens of ROS and OpenCV, for wide lenses; COLMAP's FULL_OPENCV.

    Claus and Fitzgibbon 2005, "A rational function lens distortion model for general cameras", in OpenCV's form:
    gain = (1 + k1 r^2 + k2 r^4 + k3 r^6) / (1 + k4 r^2 + k5 r^4 + k6 r^6).
    """

    distortion_model = "rational_polynomial"
    coefficients = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")

    def _gain(self, r2: Array) -> Array:
        k1, k2, _, _, k3, k4, k5, k6 = self.distortion
        return (1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1.0 + r2 * (k4 + r2 * (k5 + r2 * k6)))

    def _gain_and_slope(self, r2: Array) -> tuple[Array, Array]:
        k1, k2, _, _, k3, k4, k5, k6 = self.distortion
        denominator = 1.0 + r2 * (k4 + r2 * (k5 + r2 * k6))
        gain = (1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))) / denominator
        numerator_slope = k1 + r2 * (2.0 * k2 + r2 * (3.0 * k3))
        denominator_slope = k4 + r2 * (2.0 * k5 + r2 * (3.0 * k6))
        return gain, (numerator_slope - gain * denominator_slope) / denominator
