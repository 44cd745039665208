"""The pose of one calibrated camera from landmarks that it sees: robust Gauss-Newton on the reprojection error.

This is the first term of A eq. 8 for a single camera, with the projection of A eq. 9. The result is a pose and
its information matrix, which stand for all the image measurements when the body is solved.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.geometry import exp_se3, hat
from bodycam_ros.registration.residual_scale import residual_scale
from bodycam_ros.settings import setting

_CONVERGED = 1e-4
"""A step below this [rad, m] moves landmarks by some hundredths of a pixel; the next one would be far smaller yet."""


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
        world_T_camera: (4, 4).
        information: (6, 6) of the pose, rotation [1/rad^2] then translation [1/m^2] in camera axes.
        errors_px: (N,) reprojection errors, infinite where the camera cannot see the landmark.
        inliers: (N,) whose error is below ``inlier_px``.
    """

    world_T_camera: NDArray[np.float64]
    information: NDArray[np.float64]
    errors_px: NDArray[np.float64]
    inliers: NDArray[np.bool_]


def fit_pose(
    camera: CameraModel,
    points_world: NDArray[np.floating],
    pixels: NDArray[np.floating],
    world_T_camera: NDArray[np.float64],
    settings: PoseFitSettings,
) -> PoseFit:
    """Refine a camera's pose on its landmarks, with a Geman-McClure kernel that tightens as it converges.

    Args:
        camera: the model.
        points_world: (N, 3) landmarks [m].
        pixels: (N, 2) where the image shows them.
        world_T_camera: (4, 4) start.
        settings: noise and thresholds.
    """
    pose = world_T_camera
    scale = None
    for _ in range(settings.iterations):
        hessian, gradient, errors_px, scale = _normal_equations(camera, points_world, pixels, pose, scale, settings)
        try:
            step = -np.linalg.solve(hessian + 1e-9 * np.eye(6) * max(np.trace(hessian), 1e-9), gradient)
        except np.linalg.LinAlgError:
            break
        pose = pose @ exp_se3(np.clip(step, -0.5, 0.5))
        if scale <= settings.inlier_px and np.abs(step).max() < _CONVERGED:
            break
        scale = max(0.5 * scale, settings.inlier_px)
    else:
        hessian, _, errors_px, _ = _normal_equations(camera, points_world, pixels, pose, settings.inlier_px, settings)
    inliers = errors_px < settings.inlier_px
    sigma_px = settings.pixel_sigma * residual_scale(errors_px, inliers, settings.pixel_sigma)
    return PoseFit(pose, hessian / sigma_px**2, errors_px, inliers)


def reprojection_errors(
    camera: CameraModel,
    points_world: NDArray[np.floating],
    pixels: NDArray[np.floating],
    world_T_camera: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Reprojection errors (N,) [px] of landmarks (N, 3); infinite where the camera cannot see them."""
    projected, valid = camera.project((points_world - world_T_camera[:3, 3]) @ world_T_camera[:3, :3])
    return np.where(valid, np.linalg.norm(projected - pixels, axis=1), np.inf)


def _normal_equations(
    camera: CameraModel,
    points_world: NDArray[np.floating],
    pixels: NDArray[np.floating],
    world_T_camera: NDArray[np.float64],
    scale_px: float | None,
    settings: PoseFitSettings,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], float]:
    """Hessian (6, 6), gradient (6,) [px^2], errors (N,) and kernel scale [px] for ``world_T_camera @ exp(xi)``.

    Without a scale the errors give it: twice their median, which the right landmarks lie within.
    """
    points_camera = (points_world - world_T_camera[:3, 3]) @ world_T_camera[:3, :3]
    projected, pixel_by_point, valid = camera.project_with_jacobian(points_camera)
    residuals = (projected - pixels)[valid]
    seen_errors = np.sqrt(np.einsum("ij,ij->i", residuals, residuals))
    errors = np.full(len(pixels), np.inf)
    errors[valid] = seen_errors
    if scale_px is None:
        scale_px = float(np.clip(2 * np.median(errors), settings.inlier_px, settings.start_px))
    # The point moves by hat(p) w - v when the camera moves by the tangent vector (w, v).
    by_point = pixel_by_point[valid]
    jacobian = np.concatenate([by_point @ hat(points_camera[valid]), -by_point], axis=2).reshape(-1, 6)
    weights = np.repeat(1.0 / (1.0 + (seen_errors / scale_px) ** 2) ** 2, 2)
    weighted = jacobian * weights[:, None]
    return weighted.T @ jacobian, weighted.T @ residuals.ravel(), errors, scale_px
