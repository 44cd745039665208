"""Lenses described by angle: the distance from the image centre is a function of the angle to the optical axis.

Such a model has no pole at 90 degrees. A point in front of the camera (below 90 degrees) is valid wherever the radius
still grows with the angle; one at or beyond 90 degrees only if, on top of that, the image reaches out to that angle.
So nothing behind an ordinary lens is valid, and a lens of more than 180 degrees keeps all it can see.
"""

from abc import abstractmethod

import numpy as np

from bodycam_ros.camera.model import EDGE, FARTHEST, NEAREST, Array, CameraModel, Mask, largest_regular_angle

_WIDEST = np.radians(179.0)  # straight behind the camera the direction in the image is not defined
_TINY = 1e-300  # added to a squared distance from the axis: makes 0/0 the exact limit and vanishes elsewhere


class AngularCamera(CameraModel):
    """A camera whose distorted radius is ``_radius(angle)``, the same in all directions about the axis."""

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
        self._regular_angle = largest_regular_angle(self._is_regular, _WIDEST)
        self.max_angle = min(self._regular_angle, max(np.pi / 2.0, self._corner_angle()))
        self._max_radius = float(self._radius(np.array([self.max_angle]))[0])

    @abstractmethod
    def _radius(self, angle: Array) -> Array:
        """Distorted radius [focal lengths] at an angle to the axis [rad]."""

    @abstractmethod
    def _radius_and_slope(self, angle: Array) -> tuple[Array, Array]:
        """Distorted radius and its derivative by the angle."""

    @abstractmethod
    def _angle(self, radius: Array) -> Array:
        """Inverse of ``_radius`` for radii that angles up to ``_regular_angle`` have."""

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
        valid = radius <= self._max_radius + EDGE
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
        largest = float(self._radius(np.array([self._regular_angle]))[0])
        return float(self._angle(np.array([min(np.hypot(x, y), largest)]))[0])
