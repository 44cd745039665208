"""What every camera model offers, and the checks that all of them share.

The camera frame is ROS' optical frame: x right, y down, z along the optical axis. Pixels are OpenCV's: the centre of
the top left pixel is (0, 0). A model distorts a point to coordinates in units of the focal length; this class turns
those to pixels and keeps what lies outside the model's valid cone from passing as a measurement. ``lens_kernels``
compute all this.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from functools import cached_property
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera.lens_kernels import project_points, project_points_with_jacobian, unproject_pixels
from bodycam_ros.kernels import as_rows

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

_SAMPLES = 1000
_REFINEMENTS = 4  # each divides the bracket by _SAMPLES


class CameraModel(ABC):
    """A calibrated camera with a central lens.

    Attributes:
        name: the camera, for messages and topics.
        width, height: image size [px].
        fx, fy, cx, cy: focal lengths and principal point [px].
        distortion: the coefficients, in the order of sensor_msgs/CameraInfo.
        max_angle: half the opening of the valid cone about the optical axis [rad].
    """

    distortion_model: ClassVar[str]
    coefficients: ClassVar[tuple[str, ...]]

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
        self.name = name
        self.width = width
        self.height = height
        self.fx = fx
        self.fy = fy
        self.cx = cx
        self.cy = cy
        self.distortion = distortion
        self.max_angle = self._cone_angle()

    @property
    def pinhole(self) -> tuple[float, ...]:
        """What all models have: width, height, fx, fy, cx, cy [px], and ``max_angle`` [rad]."""
        return self.width, self.height, self.fx, self.fy, self.cx, self.cy, self.max_angle

    @property
    def k(self) -> tuple[float, ...]:
        """The 3x3 intrinsic matrix by rows [px], as sensor_msgs/CameraInfo has it."""
        return (self.fx, 0.0, self.cx, 0.0, self.fy, self.cy, 0.0, 0.0, 1.0)

    @cached_property
    def parameters(self) -> Array:
        """The lens as ``lens_kernels`` take it; not to be changed."""
        return self._parameters()

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

    @abstractmethod
    def _parameters(self) -> Array:
        """Made by ``lens_kernels.lens_vector``."""

    @abstractmethod
    def _cone_angle(self) -> float:
        """The value of ``max_angle``."""


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
"""Of the ratio of width to height: rounding to even numbers of pixels."""


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
            f"the same shape, {way}: most likely another resolution was set; record in the lens' own, or measure the "
            "lens in this one (bodycam lens)"
        )
    if abs(of_images * of_lens - 1.0) < _SAME:
        return "height for width: the camera was held, or its driver turns, by 90 degrees; turn it back"
    cut = "above and below" if of_images > of_lens else "at the sides"
    return (
        f"another shape: most likely a mode that cuts the picture {cut}, such as 16:9 in place of 4:3; record in the "
        "lens' mode, or measure the lens in this one (bodycam lens)"
    )
