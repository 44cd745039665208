"""The rational lens model of ROS and OpenCV, for wide lenses: a quotient of polynomials; COLMAP's FULL_OPENCV.

Claus and Fitzgibbon 2005, "A rational function lens distortion model for general cameras", in OpenCV's form.
"""

from bodycam_ros.camera.model import Array
from bodycam_ros.camera.perspective import PerspectiveCamera


class RationalPolynomialCamera(PerspectiveCamera):
    """gain = (1 + k1 r^2 + k2 r^4 + k3 r^6) / (1 + k4 r^2 + k5 r^4 + k6 r^6)."""

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
