"""Lenses described by angle: the distance from the image centre is a function of the angle to the optical axis.

Such a model has no pole at 90 degrees. A point in front of the camera (below 90 degrees) is valid wherever the radius
still grows with the angle; one at or beyond 90 degrees only if, on top of that, the image reaches out to that angle.
So nothing behind an ordinary lens is valid, and a lens of more than 180 degrees keeps all it can see.
"""

from abc import abstractmethod
from functools import cached_property

import numpy as np

from bodycam_ros.camera.lens_kernels import EDGE, EQUIDISTANT, FARTHEST, FOV, NEAREST, lens_vector
from bodycam_ros.camera.model import Array, CameraModel, Mask, largest_regular_angle

_WIDEST = np.radians(179.0)  # straight behind the camera the direction in the image is not defined
_TINY = 1e-300  # added to a squared distance from the axis: makes 0/0 the exact limit and vanishes elsewhere


class AngularCamera(CameraModel):
    """A camera whose distorted radius is ``_radius(angle)``, the same in all directions about the axis.

    Attributes:
        regular_angle: up to which the radius grows with the angle [rad]; ``max_angle`` or more.
        max_radius: the distorted radius at ``max_angle`` [focal lengths].
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
        self.regular_angle = largest_regular_angle(self._is_regular, _WIDEST)
        self.max_angle = min(self.regular_angle, max(np.pi / 2.0, self._corner_angle()))
        self.max_radius = float(self._radius(np.array([self.max_angle]))[0])

    @abstractmethod
    def _radius(self, angle: Array) -> Array:
        """Distorted radius [focal lengths] at an angle to the axis [rad]."""

    @abstractmethod
    def _radius_and_slope(self, angle: Array) -> tuple[Array, Array]:
        """Distorted radius and its derivative by the angle."""

    @abstractmethod
    def _angle(self, radius: Array) -> Array:
        """Inverse of ``_radius`` for radii that angles up to ``regular_angle`` have."""

    def _distort(self, x: Array, y: Array, z: Array) -> tuple[Array, Array, Mask]:
        from_axis_squared = x * x + y * y + _TINY
        from_axis = np.sqrt(from_axis_squared)
        angle = np.arctan2(from_axis, z)
        gain = self._radius(angle) / from_axis
        return gain * x, gain * y, self._in_cone(angle, from_axis_squared + z * z)

    def _distort_with_jacobian(self, x: Array, y: Array, z: Array, jacobian: Array) -> tuple[Array, Array, Mask]:
        xx, yy = x * x, y * y
        from_axis_squared = xx + yy + _TINY
        squared_distance = from_axis_squared + z * z
        from_axis = np.sqrt(from_axis_squared)
        angle = np.arctan2(from_axis, z)
        radius, slope = self._radius_and_slope(angle)
        gain = radius / from_axis
        slope /= squared_distance
        # d gain / d x = bend * x and likewise for y. The difference cancels near the axis, but it is only used times
        # a product of x and y, which is as small as the divisor.
        bend = (slope * z - gain) / from_axis_squared
        jacobian[:, 0, 0] = gain + bend * xx
        jacobian[:, 1, 1] = gain + bend * yy
        jacobian[:, 0, 1] = jacobian[:, 1, 0] = bend * x * y
        np.negative(slope, out=slope)
        jacobian[:, 0, 2] = slope * x
        jacobian[:, 1, 2] = slope * y
        return gain * x, gain * y, self._in_cone(angle, squared_distance)

    def _undistort(self, x_distorted: Array, y_distorted: Array) -> tuple[Array, Mask]:
        radius = np.sqrt(x_distorted**2 + y_distorted**2 + _TINY)
        valid = radius <= self.max_radius + EDGE
        angle = np.minimum(self._angle(np.where(valid, radius, 0.0)), self.max_angle)
        gain = np.sin(angle) / radius
        return np.column_stack([gain * x_distorted, gain * y_distorted, np.cos(angle)]), valid

    def _in_cone(self, angle: Array, squared_distance: Array) -> Mask:
        has_direction = (squared_distance > NEAREST**2) & (squared_distance < FARTHEST**2)
        return has_direction & (angle <= self.max_angle + EDGE)

    def _is_regular(self, angle: Array) -> Mask:
        radius, slope = self._radius_and_slope(angle)
        return (slope > 0.0) & (radius >= 0.0)

    def _corner_angle(self) -> float:
        """Angle [rad] of the image corner farthest from the axis, as far as the model is regular."""
        x = max(self.cx + 0.5, self.width - 0.5 - self.cx) / self.fx
        y = max(self.cy + 0.5, self.height - 0.5 - self.cy) / self.fy
        largest = float(self._radius(np.array([self.regular_angle]))[0])
        return float(self._angle(np.array([min(np.hypot(x, y), largest)]))[0])


_START_SAMPLES = 1000  # angles of the table that the inverse starts from
_MAX_STEPS = 20  # two or three are enough but at the very edge of the cone, where the slope vanishes
_CONVERGED = 1e-14  # [focal lengths]


class EquidistantCamera(AngularCamera):
    """The fisheye with a polynomial: ``equidistant`` in ROS, ``cv2.fisheye``, COLMAP's OPENCV_FISHEYE.

    Kannala and Brandt 2006, "A generic camera model and calibration method for conventional, wide-angle, and fish-eye
    lenses", with the four odd terms that OpenCV kept: at the angle a the radius is
    a (1 + k1 a^2 + k2 a^4 + k3 a^6 + k4 a^8).
    """

    distortion_model = "equidistant"
    coefficients = ("k1", "k2", "k3", "k4")

    def _parameters(self) -> Array:
        return lens_vector(
            EQUIDISTANT,
            self.pinhole,
            self.max_radius,
            self.regular_angle,
            self.distortion,
            *self.start_table,
        )

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
        """Newton from a table; the radius grows strictly with the angle up to ``regular_angle``."""
        angle = np.interp(radius, *self.start_table)
        for _ in range(_MAX_STEPS):
            reached, slope = self._radius_and_slope(angle)
            missing = radius - reached
            if np.max(np.abs(missing), initial=0.0) < _CONVERGED:
                break
            angle = np.clip(angle + missing / slope, 0.0, self.regular_angle)
        return angle

    @cached_property
    def start_table(self) -> tuple[Array, Array]:
        """Distorted radii [focal lengths], ascending, and the angles [rad] that have them: where the inverse starts."""
        angles = np.linspace(0.0, self.regular_angle, _START_SAMPLES)
        return self._radius(angles), angles


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

    def _radius(self, angle: Array) -> Array:
        return np.arctan2(self.stretch * np.sin(angle), np.cos(angle)) / self.omega

    def _radius_and_slope(self, angle: Array) -> tuple[Array, Array]:
        sin, cos = self.stretch * np.sin(angle), np.cos(angle)
        return np.arctan2(sin, cos) / self.omega, self.stretch / self.omega / (sin * sin + cos * cos)

    def _angle(self, radius: Array) -> Array:
        phase = self.omega * radius
        return np.arctan2(np.sin(phase), self.stretch * np.cos(phase))
