"""The pose fit in NumPy, matrix by matrix: what the compiled one is held to."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.readout import LONGEST_READOUT_S
from bodycam_ros.geometry import exp_se3
from bodycam_ros.registration.pose_fit import PoseFit, PoseFitSettings, row_shares
from bodycam_ros.tracking.camera_motion import ImageMotion

_CONVERGED = 1e-4
_FIXED_READOUT = 1e-7


def seen_later(
    points_camera: NDArray[np.float64], twist: NDArray[np.float64], times_s: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Points (N, 3) of the camera's frame where a camera of some twist (6,) sees them at times (N,) [s] from now.

    The exponential's series up to its second term: 10 rad/s over 6 ms leave 0.01 px.
    """
    moved = times_s[:, None] * (np.cross(points_camera, twist[:3]) - twist[3:])
    curved: NDArray[np.float64] = points_camera + moved + 0.5 * times_s[:, None] * np.cross(moved, twist[:3])
    return curved


def by_pose(pixel_by_point: NDArray[np.float64], points_camera: NDArray[np.float64]) -> NDArray[np.float64]:
    """Derivatives (N, 2, 6) of pixels by the camera's tangent (w, v): the point moves by ``hat(p) w - v``."""
    jacobian = np.empty((len(points_camera), 2, 6))
    x, y, z = points_camera.T[:, :, None]
    by_x, by_y, by_z = np.moveaxis(pixel_by_point, 2, 0)
    jacobian[:, :, 0] = by_y * z - by_z * y
    jacobian[:, :, 1] = by_z * x - by_x * z
    jacobian[:, :, 2] = by_x * y - by_y * x
    np.negative(pixel_by_point, out=jacobian[:, :, 3:])
    return jacobian


def fit_pose_in_numpy(
    camera: CameraModel,
    points_world: NDArray[np.floating],
    pixels: NDArray[np.floating],
    world_T_camera: NDArray[np.float64],
    settings: PoseFitSettings,
    motion: ImageMotion | None = None,
    iterations: int = 6,
) -> PoseFit:
    problem = Problem(camera, np.asarray(points_world, np.float64), pixels, settings, motion)
    at = Point(world_T_camera, np.zeros(6), motion.readout_time if motion else 0.0)
    scale = None
    for _ in range(iterations):
        equations = problem.linearise(at, scale)
        try:
            step = equations.step()
        except np.linalg.LinAlgError:
            break
        at = at.moved(step)
        if equations.scale_px <= settings.inlier_px and np.abs(step[:6]).max() < _CONVERGED:
            break
        scale = max(0.5 * equations.scale_px, settings.inlier_px)
    else:
        equations = problem.linearise(at, settings.inlier_px)
    readout_time, readout_information = problem.readout(equations)
    inliers = equations.errors_px < settings.inlier_px
    sigma_px = settings.pixel_sigma
    return PoseFit(
        at.world_T_camera,
        equations.pose_hessian() / sigma_px**2,
        equations.errors_px,
        inliers,
        problem.shifts(at),
        readout_time,
        readout_information / sigma_px**2,
    )


@dataclass(frozen=True)
class Point:
    """Where the fit is.

    Attributes:
        world_T_camera: (4, 4) at the exposure of the middle row.
        bend: (6,) by how much the twist differs from the images before give [rad/s, m/s].
        readout_time: [s].
    """

    world_T_camera: NDArray[np.float64]
    bend: NDArray[np.float64]
    readout_time: float

    def moved(self, step: NDArray[np.float64]) -> "Point":
        """After a step of the pose (6), or of all (13)."""
        pose = self.world_T_camera @ exp_se3(np.clip(step[:6], -0.5, 0.5))
        if len(step) == 6:
            return Point(pose, self.bend, self.readout_time)
        readout_time = float(np.clip(self.readout_time + step[12], -LONGEST_READOUT_S, LONGEST_READOUT_S))
        return Point(pose, self.bend + step[6:12], readout_time)


@dataclass(frozen=True)
class Equations:
    """The fit linearised at a point: pose (6) and, where rows are read out one by one, bend (6) and read-out time (1).

    ``jacobian`` (2V, K), ``weights`` (2V,) and ``residuals`` (2V,) are those of the V landmarks in view.
    """

    at: Point
    hessian: NDArray[np.float64]
    gradient: NDArray[np.float64]
    errors_px: NDArray[np.float64]
    scale_px: float
    jacobian: NDArray[np.float64]
    weights: NDArray[np.float64]
    residuals: NDArray[np.float64]

    def step(self) -> NDArray[np.float64]:
        """Gauss-Newton step (K,); raises LinAlgError where there is none."""
        damped = self.hessian.copy()
        diagonal = damped.ravel()[:: len(damped) + 1]
        diagonal += 1e-9 * np.maximum(diagonal, max(diagonal[:6].sum(), 1e-9))
        return np.asarray(-np.linalg.solve(damped, self.gradient))

    def pose_hessian(self) -> NDArray[np.float64]:
        """(6, 6) of the pose, whatever the rest is."""
        if len(self.hessian) == 6:
            return self.hessian
        across = self.hessian[:6, 6:]
        return np.asarray(self.hessian[:6, :6] - across @ np.linalg.solve(self.hessian[6:, 6:], across.T))


class Problem:
    """One image's landmarks, and how the camera moves meanwhile."""

    def __init__(
        self,
        camera: CameraModel,
        points_world: NDArray[np.float64],
        pixels: NDArray[np.floating],
        settings: PoseFitSettings,
        motion: ImageMotion | None,
    ) -> None:
        self._camera = camera
        self._points_world = points_world
        self._pixels = pixels
        self._settings = settings
        self._motion = motion if motion is not None and motion.is_rolling else None
        if self._motion is not None:
            self._shares = row_shares(camera, pixels)
            sigmas = np.append(self._motion.sigmas, max(self._motion.readout_sigma, _FIXED_READOUT))
            self._stiffness = (settings.pixel_sigma / sigmas) ** 2

    def linearise(self, at: Point, scale_px: float | None) -> Equations:
        """The equations at a point.

        Without a scale [px] of the kernel the errors give it: twice their median, which the right landmarks lie within.
        """
        motion = self._motion
        points = (self._points_world - at.world_T_camera[:3, 3]) @ at.world_T_camera[:3, :3]
        if motion is not None:
            twist = motion.twist_of(at.world_T_camera) + at.bend
            times_s = at.readout_time * self._shares
            points = seen_later(points, twist, times_s)
        projected, pixel_by_point, valid = self._camera.project_with_jacobian(points)
        residuals = (projected - self._pixels)[valid]
        seen_errors = np.sqrt(np.einsum("ij,ij->i", residuals, residuals))
        errors = np.full(len(self._pixels), np.inf)
        errors[valid] = seen_errors
        if scale_px is None:
            settings = self._settings
            scale_px = float(np.clip(2 * np.median(errors), settings.inlier_px, 10.0))
        weights = np.repeat(1.0 / (1.0 + (seen_errors / scale_px) ** 2) ** 2, 2)
        jacobian = by_pose(pixel_by_point[valid], points[valid])
        if motion is not None:
            # A row's own pose is that of the middle row, moved on by the twist, which the pose has a part in.
            times_s = times_s[valid, None, None]
            by_readout = self._shares[valid, None, None] * (jacobian @ twist)[:, :, None]
            jacobian = np.concatenate(
                [(1.0 + motion.gain * times_s) * jacobian, times_s * jacobian, by_readout], axis=2
            )
        jacobian = jacobian.reshape(-1, jacobian.shape[2])
        weighted = jacobian * weights[:, None]
        hessian, gradient = weighted.T @ jacobian, weighted.T @ residuals.ravel()
        if motion is not None:
            hessian[range(6, 13), range(6, 13)] += self._stiffness
            gradient[6:] += self._stiffness * np.append(at.bend, at.readout_time - motion.readout_time)
        return Equations(at, hessian, gradient, errors, scale_px, jacobian, weights, residuals.ravel())

    def shifts(self, at: Point) -> NDArray[np.float64]:
        """How far (N, 2) the read-out of the rows moves the landmarks in the image [px]."""
        if self._motion is None:
            return np.zeros((len(self._pixels), 2))
        points = (self._points_world - at.world_T_camera[:3, 3]) @ at.world_T_camera[:3, :3]
        twist = self._motion.twist_of(at.world_T_camera) + at.bend
        moved = seen_later(points, twist, at.readout_time * self._shares)
        return np.nan_to_num(self._camera.project(moved)[0] - self._camera.project(points)[0])

    def readout(self, equations: Equations) -> tuple[float, float]:
        """The read-out time by the image [s], and its information [px^2/s^2], when all else is free."""
        motion = self._motion
        if motion is None or motion.readout_sigma == 0.0 or not len(equations.residuals):
            return 0.0, 0.0
        hessian, gradient = equations.hessian.copy(), equations.gradient.copy()
        at = equations.at
        hessian[12, 12] -= self._stiffness[6]
        gradient[12] -= self._stiffness[6] * (at.readout_time - motion.readout_time)
        try:
            solved = np.linalg.solve(hessian[:-1, :-1], np.column_stack([hessian[:-1, -1], gradient[:-1]]))
        except np.linalg.LinAlgError:
            return 0.0, 0.0
        information = float(hessian[-1, -1] - hessian[-1, :-1] @ solved[:, 0])
        if information <= 0.0:
            return 0.0, 0.0
        return at.readout_time - float(gradient[-1] - hessian[-1, :-1] @ solved[:, 1]) / information, information
