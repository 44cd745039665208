"""The equidistant fisheye model with a polynomial: ``equidistant`` in ROS, ``cv2.fisheye``, COLMAP's OPENCV_FISHEYE.

Kannala and Brandt 2006, "A generic camera model and calibration method for conventional, wide-angle, and fish-eye
lenses", with the four odd terms that OpenCV kept: radius = a (1 + k1 a^2 + k2 a^4 + k3 a^6 + k4 a^8) at the angle a.
"""

from functools import cached_property

import numpy as np

from bodycam_ros.camera.angular import AngularCamera
from bodycam_ros.camera.model import Array

_START_SAMPLES = 1000  # angles of the table that the inverse starts from
_MAX_STEPS = 20  # two or three are enough but at the very edge of the cone, where the slope vanishes
_CONVERGED = 1e-14  # [focal lengths]


class EquidistantCamera(AngularCamera):
    """Kannala-Brandt fisheye."""

    distortion_model = "equidistant"
    coefficients = ("k1", "k2", "k3", "k4")

    def _radius(self, angle: Array) -> Array:
        k1, k2, k3, k4 = self.distortion
        a2 = angle * angle
        return angle * (1.0 + a2 * (k1 + a2 * (k2 + a2 * (k3 + a2 * k4))))

    def _radius_and_slope(self, angle: Array) -> tuple[Array, Array]:
        k1, k2, k3, k4 = self.distortion
        a2 = angle * angle
        slope = 1.0 + a2 * (3.0 * k1 + a2 * (5.0 * k2 + a2 * (7.0 * k3 + a2 * (9.0 * k4))))
        return angle * (1.0 + a2 * (k1 + a2 * (k2 + a2 * (k3 + a2 * k4)))), slope

    def _angle(self, radius: Array) -> Array:
        """Newton from a table; the radius grows strictly with the angle up to ``_regular_angle``."""
        angle = np.interp(radius, *self._start_table)
        for _ in range(_MAX_STEPS):
            reached, slope = self._radius_and_slope(angle)
            missing = radius - reached
            if np.max(np.abs(missing), initial=0.0) < _CONVERGED:
                break
            angle = np.clip(angle + missing / slope, 0.0, self._regular_angle)
        return angle

    @cached_property
    def _start_table(self) -> tuple[Array, Array]:
        angles = np.linspace(0.0, self._regular_angle, _START_SAMPLES)
        return self._radius(angles), angles
