"""A calibrated camera: points in front of it to pixels and back, and the cone in which its lens model holds.

The camera frame is ROS' optical frame: x right, y down, z along the optical axis. Pixels are OpenCV's: the centre of
the top left pixel is (0, 0). ``lens_kernels`` have the lens models and compute all this.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera.lens_kernels import (
    COEFFICIENTS,
    EQUIDISTANT,
    FOV,
    MAX_ANGLE,
    MAX_RADIUS,
    PERSPECTIVE,
    PROJECTION,
    REGULAR_ANGLE,
    measure_shape,
    project_points,
    project_points_with_jacobian,
    unproject_pixels,
)
from bodycam_ros.kernels import as_rows

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

_PERSPECTIVE_COEFFICIENTS = "k1", "k2", "p1", "p2", "k3"
MODELS: Final[Mapping[str, tuple[float, tuple[str, ...]]]] = {
    "plumb_bob": (PERSPECTIVE, _PERSPECTIVE_COEFFICIENTS),
    "rational_polynomial": (PERSPECTIVE, (*_PERSPECTIVE_COEFFICIENTS, "k4", "k5", "k6")),
    "equidistant": (EQUIDISTANT, ("k1", "k2", "k3", "k4")),
    "fov": (FOV, ("omega",)),
}
"""Distortion model -> its kind in ``lens_kernels``, and its coefficients; ROS has no name for ``fov``."""

_WIDEST_PERSPECTIVE = np.pi / 2.0 - 1e-6  # [rad]
_WIDEST = np.radians(179.0)  # straight behind the camera the direction in the image is not defined
_SAMPLES = 1000
_REFINEMENTS = 4  # each divides the bracket by _SAMPLES
_SMALLEST_OMEGA = 1e-8  # [rad] below it the model is the pinhole to rounding


@dataclass(frozen=True, eq=False)
class CameraModel:
    """A calibrated camera with a central lens.

    Attributes:
        name: the camera, for messages and topics.
        width, height: image size [px].
        fx, fy, cx, cy: focal lengths and principal point [px].
        distortion: the coefficients, in the order of sensor_msgs/CameraInfo.
        distortion_model: one of ``MODELS``.
    """

    name: str
    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    distortion: tuple[float, ...]
    distortion_model: str

    @property
    def max_angle(self) -> float:
        """Half the opening of the valid cone about the optical axis [rad]."""
        return float(self.parameters[MAX_ANGLE])

    @cached_property
    def parameters(self) -> Array:
        """The lens as ``lens_kernels`` take it; not to be changed.

        The cone of a perspective lens ends short of 90 degrees, or where the distortion can no longer be inverted. That
        of another one too, but at or beyond 90 degrees it reaches only as far as the image does: so nothing behind an
        ordinary lens is valid, and a lens of more than 180 degrees keeps all it can see.
        """
        kind = MODELS[self.distortion_model][0]
        lens = np.zeros(PROJECTION)
        lens[:7] = kind, self.width, self.height, self.fx, self.fy, self.cx, self.cy
        numbers = self.distortion
        if kind == FOV:
            omega = max(self.distortion[0], _SMALLEST_OMEGA)
            numbers = omega, 2.0 * np.tan(0.5 * omega)
        lens[COEFFICIENTS : COEFFICIENTS + len(numbers)] = numbers
        widest = _WIDEST_PERSPECTIVE if kind == PERSPECTIVE else _WIDEST
        regular = largest_regular_angle(lambda angles: measure_shape(lens, angles)[1], widest)
        angles = np.linspace(0.0, regular, _SAMPLES)
        radii = measure_shape(lens, angles)[0]
        lens[MAX_ANGLE], lens[REGULAR_ANGLE] = regular, regular
        if kind == PERSPECTIVE:
            lens[MAX_RADIUS] = np.tan(regular)
            return np.concatenate([lens, radii, np.tan(angles)])
        table = np.concatenate([radii, angles])
        # The corner of the image that is farthest from the axis, as far as the lens can be inverted.
        x = max(self.cx + 0.5, self.width - 0.5 - self.cx) / self.fx
        y = max(self.cy + 0.5, self.height - 0.5 - self.cy) / self.fy
        lens[MAX_RADIUS] = radii[-1]
        corner = np.array([[self.cx + self.fx * min(float(np.hypot(x, y)), radii[-1]), self.cy]])
        bearing = unproject_pixels(np.concatenate([lens, table]), corner)[0][0]
        lens[MAX_ANGLE] = min(regular, max(0.5 * np.pi, float(np.arccos(bearing[2]))))
        lens[MAX_RADIUS] = measure_shape(lens, lens[MAX_ANGLE : MAX_ANGLE + 1])[0][0]
        return np.concatenate([lens, table])

    @property
    def k(self) -> tuple[float, ...]:
        """The 3x3 intrinsic matrix by rows [px], as sensor_msgs/CameraInfo has it."""
        return (self.fx, 0.0, self.cx, 0.0, self.fy, self.cy, 0.0, 0.0, 1.0)

    def project(self, points_camera: NDArray[np.floating]) -> tuple[Array, Mask]:
        """Pixels (N, 2) of points (N, 3) [m] in the camera frame, and which of them are valid (N,).

        A point outside the valid cone is a row of NaN. A valid pixel may lie outside the image: see ``in_image``.
        """
        return project_points(self.parameters, _rows(points_camera, 3))

    def project_with_jacobian(self, points_camera: NDArray[np.floating]) -> tuple[Array, Array, Mask]:
        """Pixels (N, 2), their derivatives (N, 2, 3) [px/m] by the points (N, 3), and validity (N,).

        Rows of pixels and derivatives outside the valid cone are NaN.
        """
        return project_points_with_jacobian(self.parameters, _rows(points_camera, 3))

    def unproject(self, pixels: NDArray[np.floating]) -> tuple[Array, Mask]:
        """Unit bearings (N, 3) in the camera frame of pixels (N, 2), and which of them are valid (N,).

        A pixel that no point of the valid cone projects to is a row of NaN.
        """
        return unproject_pixels(self.parameters, _rows(pixels, 2))

    def in_image(self, pixels: NDArray[np.floating]) -> Mask:
        """Which pixels (N, 2) the sensor covers, to the outer borders of its outermost pixels; NaN is outside."""
        u, v = np.asarray(pixels).reshape(-1, 2).T
        inside: Mask = (u >= -0.5) & (u <= self.width - 0.5) & (v >= -0.5) & (v <= self.height - 0.5)
        return inside


OPTICAL_SUFFIX = "_optical_frame"


def optical_frame(camera: str) -> str:
    """Frame of a camera's image, and its link in a URDF: z forward, x right, y down."""
    return f"{camera}{OPTICAL_SUFFIX}"


def largest_regular_angle(is_regular: Callable[[Array], Mask], limit: float) -> float:
    """Largest angle [rad], at most ``limit``, such that it and all smaller ones are regular.

    Args:
        is_regular: for sorted angles (N,), where the distortion still grows outwards and can be inverted.
        limit: the widest angle to try [rad].
    """
    low, high = 0.0, limit
    for _ in range(_REFINEMENTS):
        angles = np.linspace(low, high, _SAMPLES)
        regular = is_regular(angles)
        if regular.all():
            return high
        first = max(int(np.argmin(regular)), 1)
        low, high = float(angles[first - 1]), float(angles[first])
    return low


def _rows(values: NDArray[np.floating], count: int) -> Array:
    """Rows (N, count) as the kernels take them, whatever singleton axes OpenCV put between."""
    return as_rows(np.asarray(values).reshape(-1, count))


_SAME = 0.01
"""Tolerance of the ratio of width to height: rounding to even numbers of pixels."""


def size_mismatch(lens: tuple[int, int], images: tuple[int, int]) -> str:
    """What is said of a camera whose images have another size than its lens is for; see ``mode_of_size``."""
    return (
        f"its images have {images[0]} x {images[1]} pixels, but its lens (camera_info) is for {lens[0]} x {lens[1]}; "
        f"{mode_of_size(lens, images)}"
    )


def mode_of_size(lens: tuple[int, int], images: tuple[int, int]) -> str:
    """The likely cause, and what to do, for a person.

    Args:
        lens: width and height that it is for [px].
        images: width and height that they have [px].
    """
    of_lens, of_images = lens[0] / lens[1], images[0] / images[1]
    if abs(of_images / of_lens - 1.0) < _SAME:
        way = "smaller" if images[0] < lens[0] else "larger"
        return (
            f"the same shape, but {way}: most likely another resolution was set; record in the resolution of the lens "
            "YAML, or measure the lens in this one (bodycam lens)"
        )
    if abs(of_images * of_lens - 1.0) < _SAME:
        return "width and height are exchanged: the camera or its driver turned the image by 90 degrees; turn it back"
    cut = "above and below" if of_images > of_lens else "at the sides"
    return (
        f"another shape: most likely a mode that cuts off the picture {cut}, such as 16:9 instead of 4:3; record in "
        "the mode of the lens YAML, or measure the lens in this one (bodycam lens)"
    )
