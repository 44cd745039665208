"""The pose of one calibrated camera from landmarks: robust Gauss-Newton on the reprojection error.

This is the first term of A eq. 8 for a single camera, with the projection of A eq. 9. The result is a pose and
its information matrix, which stand for all the image measurements when the body is solved. Where the rows are read out
one after the other, every landmark is projected by the pose at the time when its row is exposed.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.geometry import exp_so3
from bodycam_ros.kernels import as_rows
from bodycam_ros.registration.pose_kernels import fit_kernel
from bodycam_ros.settings import setting
from bodycam_ros.tracking.camera_motion import ImageMotion

_NOTHING = np.zeros(0)
_ITERATIONS = 6  # from a prediction within a few pixels four suffice
_START_PX = 10.0  # widest scale of the robust kernel; it starts at twice the median error and halves to the inliers'


@dataclass(frozen=True)
class PoseFitSettings:
    """Noise of the measurements."""

    pixel_sigma: float = setting(
        0.7,
        unit="px",
        limits=(0.05, 10.0),
        reason="standard deviation of a landmark in the image per axis, of patches, SIFT and map together; raise it to "
        "weigh cameras less against joints and smooth motion",
    )
    inlier_px: ClassVar[float] = 2.5  # a reprojection error beyond this is no measurement of this landmark


@dataclass(frozen=True)
class PoseFit:
    """A fitted pose.

    Attributes:
        world_T_camera: (4, 4) at the exposure of the middle row.
        information: (6, 6) of the pose, rotation [1/rad^2] then translation [1/m^2] in camera axes.
        errors_px: (N,) reprojection errors, infinite where the landmark is out of view.
        inliers: (N,) errors below ``inlier_px``.
        shifts: (N, 2) how far the read-out of the rows moved the landmarks in the image [px].
        readout_time: this image's estimate of it [s].
        readout_information: [1/s^2]; zero where it was not estimated.
    """

    world_T_camera: NDArray[np.float64]
    information: NDArray[np.float64]
    errors_px: NDArray[np.float64]
    inliers: NDArray[np.bool_]
    shifts: NDArray[np.float64]
    readout_time: float
    readout_information: float


def fit_pose(
    camera: CameraModel,
    points_world: NDArray[np.floating],
    pixels: NDArray[np.floating],
    world_T_camera: NDArray[np.float64],
    settings: PoseFitSettings,
    motion: ImageMotion | None = None,
    *,
    iterations: int = _ITERATIONS,
    inlier_px: float = PoseFitSettings.inlier_px,
    start_px: float = _START_PX,
) -> PoseFit:
    """Refine a camera's pose on its landmarks, with a Geman-McClure kernel that tightens as it converges.

    Args:
        camera: the model.
        points_world: (N, 3) landmarks [m].
        pixels: (N, 2) their places in the image.
        world_T_camera: (4, 4) initial pose.
        settings: noise.
        motion: of the camera while its rows are read out; None if all are exposed together.
        iterations: at most.
        inlier_px: final scale of the kernel, and error of an inlier [px].
        start_px: widest scale of the kernel [px].
    """
    shares = _NOTHING
    motion_vector = _NOTHING
    world_T_previous = world_T_camera
    if motion is not None and motion.is_rolling:
        shares, motion_vector = row_shares(camera, pixels), motion.as_vector
        world_T_previous = motion.world_T_previous
    return PoseFit(
        *fit_kernel(
            camera.parameters,
            as_rows(points_world),
            as_rows(pixels),
            as_rows(world_T_camera),
            float(settings.pixel_sigma),
            float(inlier_px),
            float(start_px),
            iterations,
            as_rows(shares),
            motion_vector,
            as_rows(world_T_previous),
        )
    )


def fit_numbers(settings: PoseFitSettings) -> NDArray[np.float64]:
    """What kernels of many steps fit a pose by: sigma, error of an inlier, widest scale [px], and iterations."""
    return np.array([settings.pixel_sigma, settings.inlier_px, _START_PX, _ITERATIONS])


def row_shares(camera: CameraModel, pixels: NDArray[np.floating]) -> NDArray[np.float64]:
    """Place of the rows of pixels (N, 2) in the read-out: -0.5 the first row, 0.5 the last."""
    shares: NDArray[np.float64] = np.asarray(pixels, np.float64)[:, 1] / (camera.height - 1) - 0.5
    return shares


def steady_pixels(
    camera: CameraModel, pixels: NDArray[np.floating], angular_velocity: NDArray[np.float64], readout_time: float
) -> NDArray[np.float64]:
    """Places of pixels (M, 2) if all rows were exposed with the middle one, by the camera's turning alone.

    For gates and for a search without a pose: translation moves pixels by some tenths.

    Args:
        camera: the model.
        pixels: (M, 2) in the image.
        angular_velocity: (3,) in camera axes [rad/s].
        readout_time: of the camera [s].
    """
    given = np.asarray(pixels, np.float64)
    if readout_time == 0.0 or not len(given):
        return given
    return turned_pixels(camera, given, readout_time * row_shares(camera, given)[:, None] * angular_velocity)


def turned_pixels(camera: CameraModel, pixels: NDArray[np.float64], turns: NDArray[np.float64]) -> NDArray[np.float64]:
    """Places of pixels (M, 2) whose rays are turned by (M, 3) [rad]; those that leave the view stay where they are."""
    bearings, in_view = camera.unproject(pixels)
    turned, valid = camera.project((exp_so3(turns) @ bearings[:, :, None])[:, :, 0])
    return np.where((in_view & valid)[:, None], turned, pixels)
