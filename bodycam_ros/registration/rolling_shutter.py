"""Rows that are read out one after the other: where each landmark is when its own row is exposed.

A row ``s`` in [-0.5, 0.5] from the first to the last is exposed ``s * readout_time`` after the middle one. By then a
camera of twist ``xi`` sees a point where ``exp(-s * readout_time * xi)`` takes it. The twist follows from the poses
of the images before, which the camera's own acceleration bends a little; the rows of the image itself say how much.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.geometry import exp_so3, inverse, log_se3

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ImageMotion:
    """How a camera moves while an image is taken, as far as the images before tell.

    Its twist at a pose is ``gain * log(inverse(world_T_previous) @ pose) + twist``, give or take ``sigmas``.

    Attributes:
        readout_time: from the exposure of the first row to that of the last [s]; negative from the bottom up.
        readout_sigma: its standard deviation [s]; zero if it is given.
        world_T_previous: (4, 4) pose of an image before.
        gain: what a step since then adds to the twist [1/s].
        twist: (6,) the rest of the twist, rotation [rad/s] then translation [m/s] in camera axes.
        sigmas: (6,) by how much the true twist may differ [rad/s, m/s].
        turning: (3,) angular velocity without a pose, from the tracks or from before [rad/s].
    """

    readout_time: float
    readout_sigma: float
    world_T_previous: Array
    gain: float
    twist: Array
    sigmas: Array
    turning: Array

    @property
    def sweeps(self) -> bool:
        """Whether the rows are, or may be, read out one after the other."""
        return self.readout_time != 0.0 or self.readout_sigma != 0.0

    @property
    def as_vector(self) -> Array:
        """As ``pose_kernels`` take it (15,): read-out time and its sigma, gain, twist, sigmas."""
        return np.concatenate([[self.readout_time, self.readout_sigma, self.gain], self.twist, self.sigmas])

    def twist_at(self, world_T_camera: Array) -> Array:
        """(6,) [rad/s, m/s]."""
        step: Array = log_se3(inverse(self.world_T_previous) @ world_T_camera)
        return self.gain * step + self.twist


def row_shares(camera: CameraModel, pixels: NDArray[np.floating]) -> Array:
    """Where in the read-out the rows of pixels (N, 2) are: -0.5 the first row, 0.5 the last."""
    shares: Array = np.asarray(pixels, np.float64)[:, 1] / (camera.height - 1) - 0.5
    return shares


def seen_later(points_camera: Array, twist: Array, times_s: Array) -> Array:
    """Points (N, 3) of the camera's frame where a camera of some twist (6,) sees them at times (N,) [s] from now.

    The exponential's series up to its second term: 10 rad/s over 6 ms leave 0.01 px.
    """
    moved = times_s[:, None] * (np.cross(points_camera, twist[:3]) - twist[3:])
    curved: Array = points_camera + moved + 0.5 * times_s[:, None] * np.cross(moved, twist[:3])
    return curved


def steady_pixels(
    camera: CameraModel, pixels: NDArray[np.floating], angular_velocity: Array, readout_time: float
) -> NDArray[np.float64]:
    """Where pixels (M, 2) would be if all rows were exposed with the middle one, by the camera's turning alone.

    For gates and for a search without a pose: what moves by translation is some tenths of a pixel.

    Args:
        camera: the model.
        pixels: (M, 2) as the image shows them.
        angular_velocity: (3,) in camera axes [rad/s].
        readout_time: of the camera [s].
    """
    given = np.asarray(pixels, np.float64)
    if readout_time == 0.0 or not len(given):
        return given
    bearings, in_view = camera.unproject(given)
    turns = exp_so3(readout_time * row_shares(camera, given)[:, None] * angular_velocity)
    steady, valid = camera.project((turns @ bearings[:, :, None])[:, :, 0])
    return np.where((in_view & valid)[:, None], steady, given)


def by_pose(pixel_by_point: Array, points_camera: Array) -> Array:
    """Derivatives (N, 2, 6) of pixels by the camera's tangent (w, v): the point moves by ``hat(p) w - v``."""
    jacobian = np.empty((len(points_camera), 2, 6))
    x, y, z = points_camera.T[:, :, None]
    by_x, by_y, by_z = np.moveaxis(pixel_by_point, 2, 0)
    jacobian[:, :, 0] = by_y * z - by_z * y
    jacobian[:, :, 1] = by_z * x - by_x * z
    jacobian[:, :, 2] = by_x * y - by_y * x
    np.negative(pixel_by_point, out=jacobian[:, :, 3:])
    return jacobian
