"""The field-of-view model with one coefficient omega, as COLMAP's FOV; sensor_msgs and OpenCV have no name for it.

Devernay and Faugeras 2001, "Straight lines have to be straight": r_d = atan(2 r_u tan(omega / 2)) / omega, where r_u is
the radius in the perspective image. With r_u = tan(a) it becomes a function of the angle a that grows smoothly beyond
90 degrees, where COLMAP ends; ``atan2`` continues it.
"""

import numpy as np

from bodycam_ros.camera.angular import AngularCamera
from bodycam_ros.camera.model import Array

_SMALLEST_OMEGA = 1e-8  # [rad] below it the model is the pinhole to rounding


class FovCamera(AngularCamera):
    """Devernay-Faugeras wide-angle lens; omega = 0 is the pinhole."""

    distortion_model = "fov"
    coefficients = ("omega",)

    @property
    def _omega(self) -> float:
        return max(self.distortion[0], _SMALLEST_OMEGA)

    @property
    def _stretch(self) -> float:
        return float(2.0 * np.tan(self._omega / 2.0))

    def _radius(self, angle: Array) -> Array:
        return np.arctan2(self._stretch * np.sin(angle), np.cos(angle)) / self._omega

    def _radius_and_slope(self, angle: Array) -> tuple[Array, Array]:
        sin, cos = self._stretch * np.sin(angle), np.cos(angle)
        return np.arctan2(sin, cos) / self._omega, self._stretch / self._omega / (sin * sin + cos * cos)

    def _angle(self, radius: Array) -> Array:
        phase = self._omega * radius
        return np.arctan2(np.sin(phase), self._stretch * np.cos(phase))
