"""A lens and the places of a board that explain pictures of it best: one bundle, whatever the camera model.

Levenberg-Marquardt on our own camera models. Poses are eliminated picture by picture (Schur complement), so that what
is solved has the size of the lens alone. Points that do not fit count less, by Cauchy's weights.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.boards.board_detector import BoardView, board_pose
from bodycam_ros.camera import CameraModel, camera_from_info
from bodycam_ros.camera.lens_kernels import COEFFICIENTS, measure_shape, project_points
from bodycam_ros.camera.model import MODELS
from bodycam_ros.errors import LensError
from bodycam_ros.geometry import Array, exp_so3, hat, rigid
from bodycam_ros.kernels import as_rows

_STEP = 1e-6  # of a coefficient, for its derivative


def _derivatives_by_lens(camera: CameraModel, points_camera: Array) -> Array:
    """Derivatives (N, 2, 4 + D) of the pixels of points (N, 3) by fx, fy, cx, cy and the D coefficients.

    Zero where a lens that differs by a step does not see the point.
    """
    lens, points = lens_numbers(camera), as_rows(points_camera)
    pixels = camera.project(points)[0]
    derivatives = np.zeros((len(pixels), 2, len(lens)))
    derivatives[:, [0, 1], [0, 1]] = (pixels - lens[2:4]) / lens[:2]
    derivatives[:, [0, 1], [2, 3]] = 1.0
    for number in range(4, len(lens)):
        step = _STEP * (np.arange(len(lens)) == number)
        # The valid cone stays as it is, which takes long to find; but fov has a second coefficient that follows omega.
        moved = with_lens(camera, lens + step).parameters if len(lens) == 5 else camera.parameters.copy()
        moved[COEFFICIENTS + number - 4] = (lens + step)[number]
        derivatives[:, :, number] = (project_points(moved, points)[0] - pixels) / _STEP
    derivatives[~np.isfinite(derivatives).all(axis=(1, 2))] = 0.0
    return derivatives


_ROUNDS = 4  # of weights; the scale of the errors is found anew before each
_STEPS = 40
_CONVERGED = 1e-9  # share of the cost
_LOST_PX = 1e3  # the error of a point that the lens cannot see
_FIRST_SCALE_PX = 5.0
_LEAST_SCALE_PX = 0.02
_TAIL = 3.0  # of the errors' scale: what is farther off counts a half or less
_MAD = 1.4826 / 1.1774  # a median of lengths in the plane to the standard deviation along one axis


@dataclass(frozen=True, eq=False)
class LensFit:
    """A lens, and where the board was; points (N) are those of all pictures, one after the other.

    Attributes:
        camera: the lens.
        views: the pictures that it was fitted to.
        poses: (V, 4, 4) camera_T_board of each.
    """

    camera: CameraModel
    views: tuple[BoardView, ...]
    poses: Array

    @cached_property
    def pixels(self) -> Array:
        """(N, 2) where the points are."""
        return np.concatenate([view.pixels for view in self.views])

    @cached_property
    def spreads(self) -> Array:
        """(N,) how uncertain they are."""
        return np.concatenate([view.spreads for view in self.views])

    @cached_property
    def rows(self) -> NDArray[np.int64]:
        """(N,) picture of each."""
        return np.repeat(np.arange(len(self.views)), [len(view.pixels) for view in self.views])

    @cached_property
    def points_camera(self) -> Array:
        """(N, 3) in the camera [m]."""
        points = np.concatenate([view.points_board for view in self.views])
        turned: Array = np.einsum("nij,nj->ni", self.poses[self.rows, :3, :3], points)
        return turned + self.poses[self.rows, :3, 3]

    @cached_property
    def residuals(self) -> Array:
        """(N, 2) projected minus measured [px], over the point's spread."""
        projected, valid = self.camera.project(self.points_camera)
        return np.where(valid[:, None], projected - self.pixels, _LOST_PX) / self.spreads[:, None]

    @cached_property
    def errors_px(self) -> Array:
        """(N,) from where a point was measured to where it projects."""
        errors: Array = np.linalg.norm(self.residuals, axis=1) * self.spreads
        return errors

    @property
    def median_px(self) -> float:
        """Median error of a point [px]."""
        return float(np.median(self.errors_px))


def with_lens(camera: CameraModel, lens: Array) -> CameraModel:
    """A camera of the same kind with other numbers (fx, fy, cx, cy, distortion)."""
    fx, fy, cx, cy, *distortion = lens.tolist()
    return replace(camera, fx=fx, fy=fy, cx=cx, cy=cy, distortion=tuple(distortion))


def lens_numbers(camera: CameraModel) -> Array:
    """fx, fy, cx, cy [px] and the distortion."""
    return np.array([camera.fx, camera.fy, camera.cx, camera.cy, *camera.distortion])


def fit_lens(
    camera: CameraModel, views: Sequence[BoardView], poses: Array, fixed: bool = False, rounds: int = _ROUNDS
) -> LensFit:
    """Fit lens and poses.

    Args:
        camera: where to start, and the model.
        views: the pictures.
        poses: (V, 4, 4) camera_T_board to start from.
        fixed: leave the lens as it is, for pictures that it was not fitted to.
        rounds: how often the weights are found anew.
    """
    fit, scale = LensFit(camera, tuple(views), poses), _FIRST_SCALE_PX
    for _ in range(rounds):
        median = float(np.median(np.linalg.norm(fit.residuals, axis=1)))
        scale = min(scale, _TAIL * max(_LEAST_SCALE_PX, _MAD * median))
        fit = _descend(fit, scale, fixed)
    return fit


def _descend(fit: LensFit, scale: float, fixed: bool) -> LensFit:
    """The fit at the least cost."""
    damping, cost = 1e-3, _cost(fit, scale)
    for _ in range(_STEPS):
        equations = _normal_equations(fit, scale, fixed)
        while damping < 1e8:
            new = _moved(fit, *_solve(*equations, damping))
            new_cost = _cost(new, scale) if new else np.inf
            if new and new_cost < cost:
                break
            damping *= 10.0
        else:
            break
        gain = (cost - new_cost) / cost
        fit = new
        cost = new_cost
        damping = max(1e-12, 0.1 * damping)
        if gain < _CONVERGED:
            break
    return fit


def _normal_equations(fit: LensFit, scale: float, fixed: bool) -> tuple[Array, Array]:
    """Matrices (V, 6 + L, 6 + L) and right sides (V, 6 + L) of each picture: pose, then lens unless fixed."""
    _, by_point, valid = fit.camera.project_with_jacobian(fit.points_camera)
    parts = [-by_point @ hat(fit.points_camera), by_point]
    parts += [] if fixed else [_derivatives_by_lens(fit.camera, fit.points_camera)]
    J = np.where(valid[:, None, None], np.concatenate(parts, axis=2), 0.0) / fit.spreads[:, None, None]
    weights = 1.0 / (1.0 + np.sum(fit.residuals**2, axis=1) / scale**2)
    weighted = np.swapaxes(J, 1, 2) * weights[:, None, None]
    right, starts = (weighted @ fit.residuals[:, :, None])[..., 0], np.searchsorted(fit.rows, range(len(fit.views)))
    return np.add.reduceat(weighted @ J, starts, axis=0), np.add.reduceat(right, starts, axis=0)


def _solve(matrices: Array, right: Array, damping: float) -> tuple[Array, Array]:
    """Changes of the poses (V, 6) and of the lens (L,) by the normal equations of each picture (Schur complement)."""
    size = right.shape[1]
    damped = matrices * (1.0 + damping * np.eye(size)) + np.diag(np.repeat([1e-12, 0.0], [6, size - 6]))
    between = matrices[:, :6, 6:]
    eliminated = np.linalg.solve(damped[:, :6, :6], np.concatenate([between, right[:, :6, None]], axis=2))
    across, along = eliminated[:, :, :-1], eliminated[:, :, -1]
    reduced = damped[:, 6:, 6:].sum(axis=0) - np.einsum("vij,vik->jk", between, across)
    wanted = right[:, 6:].sum(axis=0) - np.einsum("vij,vi->j", between, along)
    if not len(wanted):
        return -along, wanted
    # Scaled, since focal lengths are hundreds and coefficients may be thousandths.
    scale = 1.0 / np.sqrt(np.maximum(np.diag(matrices[:, 6:, 6:].sum(axis=0)), 1e-12))
    lens_step = -scale * np.linalg.lstsq(reduced * scale * scale[:, None], wanted * scale, rcond=1e-13)[0]
    return -(along + across @ lens_step), lens_step


def _moved(fit: LensFit, pose_steps: Array, lens_step: Array) -> LensFit | None:
    """The fit with poses turned and shifted in the camera frame (V, 6), and another lens; None if there is no such."""
    poses = exp_so3(pose_steps[:, :3]) @ fit.poses[:, :3]
    poses = rigid(poses[:, :, :3], poses[:, :, 3] + pose_steps[:, 3:])
    camera = fit.camera
    if len(lens_step):
        lens = lens_numbers(camera) + lens_step
        largest = 20.0 * max(camera.width, camera.height)
        if not (np.isfinite(lens).all() and (lens[:2] > 1.0).all() and (lens[:2] < largest).all()):
            return None
        if camera.distortion_model == "fov" and not 0.0 <= lens[4] < np.pi - 0.01:
            return None
        camera = with_lens(camera, lens)
    return LensFit(camera, fit.views, poses)


def _cost(fit: LensFit, scale: float) -> float:
    return float(np.log1p(np.sum(fit.residuals**2, axis=1) / scale**2).sum())


_FOCAL_OF_WIDTH = np.geomspace(0.18, 3.0, 22)
_TRIED = 12  # pictures that focal lengths are tried on
_MIN_VIEWS = 3
_ANGLES = 60
_SOME_OMEGA = 0.9  # [rad] of a fov lens to begin with; at 0 nothing shows which way to go
_STEEPEST_DEG = 80.0  # beyond it a perspective image is useless


def initial_fit(views: Sequence[BoardView], width: int, height: int) -> LensFit:
    """An equidistant lens with the pictures' poses: with its four coefficients it resembles any lens.

    Raises:
        LensError: no lens explains the pictures.
    """
    most_points = sorted(views, key=lambda view: -len(view.pixels))
    tried = most_points[: 3 * _TRIED : 3] if len(views) >= 3 * _TRIED else most_points[:_TRIED]
    cameras = [_plain(focal * max(width, height), width, height) for focal in _FOCAL_OF_WIDTH.tolist()]
    return fit_unplaced(min(cameras, key=lambda camera: _start_cost(camera, tried)), views)


def fit_unplaced(camera: CameraModel, views: Sequence[BoardView]) -> LensFit:
    """Fit a lens that is roughly known to pictures whose poses are not.

    Raises:
        LensError: fewer than three of them can be placed by it.
    """
    placed = [(view, found[0]) for view in views if (found := board_pose(camera, view)) is not None]
    if len(placed) < _MIN_VIEWS:
        raise LensError(
            f"{len(placed)} of {len(views)} pictures fit any lens, {_MIN_VIEWS} are needed: check that the file is "
            "that of this board, with its counts and sizes"
        )
    return fit_lens(camera, [view for view, _ in placed], np.array([pose for _, pose in placed]))


def as_model(model: str, fit: LensFit) -> CameraModel:
    """A camera of another model that resembles a fitted one out to where that saw the board."""
    from scipy.optimize import least_squares

    camera = fit.camera
    if model == camera.distortion_model:
        return camera
    rays, valid = camera.unproject(fit.pixels)
    widest = float(np.arccos(np.clip(rays[valid][:, 2].min(), -1.0, 1.0)))
    if model in ("plumb_bob", "rational_polynomial"):
        widest = min(widest, np.radians(_STEEPEST_DEG))
    angles = np.linspace(0.0, widest, _ANGLES)[1:]
    radii = measure_shape(camera.parameters, angles)[0]
    is_radial = [not coefficient.startswith("p") for coefficient in MODELS[model][1]]

    def resembling(shape: Array) -> CameraModel:
        """The camera whose focal lengths are a share of the fitted ones, with these radial coefficients."""
        distortion = np.zeros(len(is_radial))
        distortion[is_radial] = shape[1:]
        scaled = replace(camera, fx=shape[0] * camera.fx, fy=shape[0] * camera.fy)
        return replace(scaled, distortion=tuple(distortion.tolist()), distortion_model=model)

    def errors(shape: Array) -> Array:
        difference: Array = shape[0] * measure_shape(resembling(shape).parameters, angles)[0] - radii
        return difference

    start = [1.0, *[_SOME_OMEGA if model == "fov" else 0.0] * sum(is_radial)]
    return resembling(least_squares(errors, start, x_scale="jac", max_nfev=100).x)


def _plain(focal_px: float, width: int, height: int) -> CameraModel:
    k = [focal_px, 0.0, 0.5 * (width - 1), 0.0, focal_px, 0.5 * (height - 1), 0.0, 0.0, 1.0]
    return camera_from_info("camera", width, height, "equidistant", [0.0] * 4, k)


def _start_cost(camera: CameraModel, views: Sequence[BoardView]) -> float:
    """Mean of the pictures' median errors [px], those that cannot be placed counted as far off."""
    far = float(max(camera.width, camera.height))
    errors = [far if (found := board_pose(camera, view)) is None else min(far, found[1]) for view in views]
    return float(np.mean(errors))
