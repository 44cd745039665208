"""The pose of one calibrated camera from landmarks that it sees: robust Gauss-Newton on the reprojection error.

This is the first term of A eq. 8 for a single camera, with the projection of A eq. 9. The result is a pose and
its information matrix, which stand for all the image measurements when the body is solved. Where the rows are read out
one after the other, every landmark is projected from where the camera is when its row is exposed.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.kernels import as_rows
from bodycam_ros.registration.pose_kernels import fit_kernel
from bodycam_ros.registration.recent_path import ImageMotion, row_shares
from bodycam_ros.settings import setting

_NOTHING = np.zeros(0)


@dataclass(frozen=True)
class PoseFitSettings:
    """Noise of the measurements, and how outliers are told from them."""

    pixel_sigma: float = setting(
        0.7,
        unit="px",
        limits=(0.05, 10.0),
        reason="flow, SIFT and map together, per axis; sets the weight of a camera against joints and smoothness",
    )
    inlier_px: float = setting(
        2.5, unit="px", limits=(0.5, 20.0), reason="a reprojection error beyond this is no measurement of this landmark"
    )
    iterations: int = setting(6, limits=(1, 50), reason="from a prediction within a few pixels four suffice")
    start_px: float = setting(
        10.0,
        unit="px",
        limits=(0.5, 100.0),
        reason="widest scale of the robust kernel; it starts at twice the median error and halves down to inlier_px",
    )


@dataclass(frozen=True)
class PoseFit:
    """A fitted pose.

    Attributes:
        world_T_camera: (4, 4) at the exposure of the middle row.
        information: (6, 6) of the pose, rotation [1/rad^2] then translation [1/m^2] in camera axes.
        errors_px: (N,) reprojection errors, infinite where the camera cannot see the landmark.
        inliers: (N,) whose error is below ``inlier_px``.
        shifts: (N, 2) how far the read-out of the rows moved the landmarks in the image [px].
        readout_time: what this image says of it [s].
        readout_information: [1/s^2]; zero where it was not asked for.
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
) -> PoseFit:
    """Refine a camera's pose on its landmarks, with a Geman-McClure kernel that tightens as it converges.

    Args:
        camera: the model.
        points_world: (N, 3) landmarks [m].
        pixels: (N, 2) where the image shows them.
        world_T_camera: (4, 4) start.
        settings: noise and thresholds.
        motion: how the camera moves while its rows are read out; None if all are exposed together.
    """
    shares, motion_vector, world_T_previous = _NOTHING, _NOTHING, world_T_camera
    if motion is not None and motion.sweeps:
        shares, motion_vector = row_shares(camera, pixels), motion.as_vector
        world_T_previous = motion.world_T_previous
    return PoseFit(
        *fit_kernel(
            camera.parameters,
            as_rows(points_world),
            as_rows(pixels),
            as_rows(world_T_camera),
            float(settings.pixel_sigma),
            float(settings.inlier_px),
            float(settings.start_px),
            settings.iterations,
            as_rows(shares),
            motion_vector,
            as_rows(world_T_previous),
        )
    )


def reprojection_errors(
    camera: CameraModel,
    points_world: NDArray[np.floating],
    pixels: NDArray[np.floating],
    world_T_camera: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Reprojection errors (N,) [px] of landmarks (N, 3); infinite where the camera cannot see them."""
    projected, valid = camera.project((points_world - world_T_camera[:3, 3]) @ world_T_camera[:3, :3])
    return np.where(valid, np.linalg.norm(projected - pixels, axis=1), np.inf)
