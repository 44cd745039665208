"""Lenses described by angle: the distance from the image centre is a function of the angle to the optical axis.

Such a model has no pole at 90 degrees. A point in front of the camera (below 90 degrees) is valid wherever the radius
still grows with the angle; one at or beyond 90 degrees only if, on top of that, the image reaches out to that angle.
So nothing behind an ordinary lens is valid, and a lens of more than 180 degrees keeps all it can see.
"""

from abc import abstractmethod
from functools import cached_property

import numpy as np

from bodycam_ros.camera.lens_kernels import EDGE, EQUIDISTANT, FOV, lens_vector
from bodycam_ros.camera.model import Array, CameraModel, Mask, largest_regular_angle

_WIDEST = np.radians(179.0)  # straight behind the camera the direction in the image is not defined
_SAMPLES = 1000  # angles of the table that the inverse starts from
_STEPS = 5  # of Newton from there


class AngularCamera(CameraModel):
    """A camera whose distorted radius is a function of the angle, the same in all directions about the axis."""

    @cached_property
    def regular_angle(self) -> float:
        """Angle up to which the radius grows with it [rad]; ``max_angle`` or more."""
        return largest_regular_angle(self._is_regular, _WIDEST)

    @cached_property
    def max_radius(self) -> float:
        """The distorted radius at ``max_angle`` [focal lengths]."""
        return float(self._radius_and_slope(np.array([self.max_angle]))[0][0])

    def _cone_angle(self) -> float:
        return min(self.regular_angle, max(np.pi / 2.0, self._corner_angle()))

    @abstractmethod
    def _radius_and_slope(self, angle: Array) -> tuple[Array, Array]:
        """Distorted radius [focal lengths] at angles to the axis [rad], and its derivative."""

    def _is_regular(self, angle: Array) -> Mask:
        radius, slope = self._radius_and_slope(angle)
        return (slope > 0.0) & (radius >= 0.0)

    def _corner_angle(self) -> float:
        """Angle [rad] of the image corner farthest from the axis, as far as the model is regular."""
        x = max(self.cx + 0.5, self.width - 0.5 - self.cx) / self.fx
        y = max(self.cy + 0.5, self.height - 0.5 - self.cy) / self.fy
        radii, angles = self.start_table
        wanted = min(float(np.hypot(x, y)), float(radii[-1]))
        angle = np.interp([wanted], radii, angles)
        for _ in range(_STEPS):
            radius, slope = self._radius_and_slope(angle)
            angle = np.clip(angle + (wanted - radius) / np.maximum(slope, EDGE), 0.0, self.regular_angle)
        return float(angle[0])

    @cached_property
    def start_table(self) -> tuple[Array, Array]:
        """Distorted radii [focal lengths], ascending, and the angles [rad] that have them: where the inverse starts."""
        angles = np.linspace(0.0, self.regular_angle, _SAMPLES)
        return self._radius_and_slope(angles)[0], angles


class EquidistantCamera(AngularCamera):
    """The fisheye with a polynomial: ``equidistant`` in ROS, ``cv2.fisheye``, COLMAP's OPENCV_FISHEYE.

    Kannala and Brandt 2006, "A generic camera model and calibration method for conventional, wide-angle, and fish-eye
    lenses", with the four odd terms that OpenCV kept: at the angle a the radius is
    a (1 + k1 a^2 + k2 a^4 + k3 a^6 + k4 a^8).
    """

    distortion_model = "equidistant"
    coefficients = ("k1", "k2", "k3", "k4")

    def _parameters(self) -> Array:
        numbers = self.max_radius, self.regular_angle, self.distortion
        return lens_vector(EQUIDISTANT, self.pinhole, *numbers, *self.start_table)

    def _radius_and_slope(self, angle: Array) -> tuple[Array, Array]:
        k1, k2, k3, k4 = self.distortion
        a2 = angle * angle
        slope = 1.0 + a2 * (3.0 * k1 + a2 * (5.0 * k2 + a2 * (7.0 * k3 + a2 * (9.0 * k4))))
        return angle * (1.0 + a2 * (k1 + a2 * (k2 + a2 * (k3 + a2 * k4)))), slope


_SMALLEST_OMEGA = 1e-8  # [rad] below it the model is the pinhole to rounding


class FovCamera(AngularCamera):
    """The field-of-view model with one coefficient omega, as COLMAP's FOV; omega = 0 is the pinhole.

    Devernay and Faugeras 2001, "Straight lines have to be straight": r_d = atan(2 r_u tan(omega / 2)) / omega, where
    r_u is the radius in the perspective image. With r_u = tan(a) it becomes a function of the angle a that grows
    smoothly beyond 90 degrees, where COLMAP ends; ``atan2`` continues it. sensor_msgs and OpenCV have no name for it.
    """

    distortion_model = "fov"
    coefficients = ("omega",)

    @property
    def omega(self) -> float:
        """The coefficient, not quite zero [rad]."""
        return max(self.distortion[0], _SMALLEST_OMEGA)

    @property
    def stretch(self) -> float:
        """2 tan(omega / 2)."""
        return float(2.0 * np.tan(self.omega / 2.0))

    def _parameters(self) -> Array:
        return lens_vector(FOV, self.pinhole, self.max_radius, self.regular_angle, (self.omega, self.stretch))

    def _radius_and_slope(self, angle: Array) -> tuple[Array, Array]:
        sin, cos = self.stretch * np.sin(angle), np.cos(angle)
        return np.arctan2(sin, cos) / self.omega, self.stretch / self.omega / (sin * sin + cos * cos)
