"""Lenses described in the perspective image: radial and tangential distortion of (x/z, y/z).

Brown 1966, in OpenCV's form: with r^2 = x^2 + y^2 in the image plane at z = 1,
    x_d = gain(r^2) x + 2 p1 x y + p2 (r^2 + 2 x^2) = (gain(r^2) + tilt) x + p2 r^2
    y_d = gain(r^2) y + p1 (r^2 + 2 y^2) + 2 p2 x y = (gain(r^2) + tilt) y + p1 r^2,  tilt = 2 (p1 y + p2 x)
The valid cone ends short of 90 degrees, or where the distortion can no longer be inverted: a pole of the gain, or a
vanishing determinant of its derivative in any direction about the axis.
"""

from functools import cached_property

import numpy as np

from bodycam_ros.camera.lens_kernels import PERSPECTIVE, lens_vector
from bodycam_ros.camera.model import Array, CameraModel, Mask, largest_regular_angle

_WIDEST = np.pi / 2.0 - 1e-6  # [rad]
_DIRECTIONS = 24  # in which the determinant is tried
_START_SAMPLES = 1000  # angles of the table that the inverse starts from


class PerspectiveCamera(CameraModel):
    """A camera with a radial gain and the tangential coefficients p1 and p2."""

    def _cone_angle(self) -> float:
        return largest_regular_angle(self._is_regular, _WIDEST)

    @property
    def max_radius(self) -> float:
        """The undistorted radius at ``max_angle`` [focal lengths]."""
        return float(np.tan(self.max_angle))

    @cached_property
    def start_table(self) -> tuple[Array, Array]:
        """Distorted radii, ascending, and the undistorted ones that have them without p1 and p2."""
        radii = np.tan(np.linspace(0.0, self.max_angle, _START_SAMPLES))
        return radii * self._gain_and_slope(radii * radii)[0], radii

    def _gain_and_slope(self, r2: Array) -> tuple[Array, Array]:
        """Distorted over undistorted radius, without tangential terms, and its derivative by the squared radius."""
        k1, k2, _, _, k3, k4, k5, k6 = (*self.distortion, 0.0, 0.0, 0.0)[:8]
        denominator = 1.0 + r2 * (k4 + r2 * (k5 + r2 * k6))
        gain = (1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))) / denominator
        numerator_slope = k1 + r2 * (2.0 * k2 + r2 * (3.0 * k3))
        denominator_slope = k4 + r2 * (2.0 * k5 + r2 * (3.0 * k6))
        return gain, (numerator_slope - gain * denominator_slope) / denominator

    def _parameters(self) -> Array:
        return lens_vector(PERSPECTIVE, self.pinhole, self.max_radius, 0.0, self.distortion, *self.start_table)

    def _is_regular(self, angle: Array) -> Mask:
        """By the determinant of the derivatives of x_d and y_d in the image plane."""
        direction = np.linspace(0.0, 2.0 * np.pi, _DIRECTIONS, endpoint=False)[:, None]
        radius, (p1, p2) = np.tan(angle), self.distortion[2:4]
        x, y, r2 = radius * np.cos(direction), radius * np.sin(direction), radius * radius
        gain, slope = self._gain_and_slope(r2)
        along = gain + 2.0 * p1 * y + 2.0 * p2 * x
        xx, yy = along + (2.0 * slope * x + 4.0 * p2) * x, along + (2.0 * slope * y + 4.0 * p1) * y
        xy = 2.0 * (slope * x * y + p1 * x + p2 * y)
        regular: Mask = (xx * yy - xy * xy > 0.0).all(axis=0) & (gain > 0.0)
        return regular


class PlumbBobCamera(PerspectiveCamera):
    """The ordinary lens of ROS and OpenCV; COLMAP's OPENCV if k3 = 0. gain = 1 + k1 r^2 + k2 r^4 + k3 r^6."""

    distortion_model = "plumb_bob"
    coefficients = ("k1", "k2", "p1", "p2", "k3")


class RationalPolynomialCamera(PerspectiveCamera):
    """The rational lens of ROS and OpenCV, for wide lenses; COLMAP's FULL_OPENCV.

    Claus and Fitzgibbon 2005, "A rational function lens distortion model for general cameras", in OpenCV's form:
    gain = (1 + k1 r^2 + k2 r^4 + k3 r^6) / (1 + k4 r^2 + k5 r^4 + k6 r^6).
    """

    distortion_model = "rational_polynomial"
    coefficients = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")
