"""A lens and the places of a board that explain pictures of it best: one bundle, whatever the camera model.

Levenberg-Marquardt on our own camera models. Poses are eliminated picture by picture (Schur complement), so that what
is solved has the size of the lens alone. Points that do not fit count less, by Cauchy's weights.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel, camera_from_info
from bodycam_ros.errors import LensError
from bodycam_ros.geometry import Array, exp_so3, hat, rigid
from bodycam_ros.lens.board_detector import BoardView, board_pose

_TINY = 1e-300
_OMEGA_STEP = 1e-6


def derivatives_by_lens(camera: CameraModel, points_camera: Array) -> Array:
    """Derivatives (N, 2, 4 + D) of the pixels of points (N, 3) by fx, fy, cx, cy and the D coefficients.

    They are meaningless where the lens does not see a point.
    """
    with np.errstate(all="ignore"):
        if camera.distortion_model == "equidistant":
            plane, by_coefficients = _equidistant(camera.distortion, points_camera)
        elif camera.distortion_model == "fov":
            plane, by_coefficients = _fov(camera.distortion[0], points_camera)
        else:
            plane, by_coefficients = _perspective(camera.distortion, points_camera)
    derivatives = np.zeros((len(points_camera), 2, 4 + len(camera.distortion)))
    derivatives[:, 0, 0], derivatives[:, 1, 1] = plane.T
    derivatives[:, 0, 2] = derivatives[:, 1, 3] = 1.0
    derivatives[:, :, 4:] = by_coefficients * np.array([[camera.fx], [camera.fy]])
    return derivatives


def _equidistant(k: tuple[float, ...], points: Array) -> tuple[Array, Array]:
    """Distorted coordinates (N, 2) [focal lengths] and their derivatives (N, 2, 4)."""
    angle, direction = _angle(points)
    powers = angle[:, None] ** np.array([1.0, 3.0, 5.0, 7.0, 9.0])
    return direction * (powers @ np.array([1.0, *k]))[:, None], direction[:, :, None] * powers[:, None, 1:]


def _fov(omega: float, points: Array) -> tuple[Array, Array]:
    angle, direction = _angle(points)

    def radius(w: float) -> Array:
        values: Array = np.arctan2(2.0 * np.tan(0.5 * w) * np.sin(angle), np.cos(angle)) / w
        return values

    w = max(omega, 2.0 * _OMEGA_STEP)
    slope = (radius(w + _OMEGA_STEP) - radius(w - _OMEGA_STEP)) / (2.0 * _OMEGA_STEP)
    return direction * radius(w)[:, None], direction[:, :, None] * slope[:, None, None]


def _perspective(d: tuple[float, ...], points: Array) -> tuple[Array, Array]:
    """plumb_bob (k1, k2, p1, p2, k3), and rational_polynomial, which goes on with k4, k5, k6 of the denominator."""
    k1, k2, p1, p2, k3, *rest = d
    at = points[:, :2] / points[:, 2:]
    x, y = at.T
    r2 = x * x + y * y
    powers = np.stack([r2, r2**2, r2**3], axis=1)
    above, below = 1.0 + powers @ np.array([k1, k2, k3]), 1.0 + powers @ np.array(rest or [0.0, 0.0, 0.0])
    gain = above / below
    plane = at * (gain + 2.0 * p1 * y + 2.0 * p2 * x)[:, None] + np.stack([p2 * r2, p1 * r2], axis=1)
    derivatives = np.empty((len(points), 2, len(d)))
    derivatives[:, :, [0, 1, 4]] = at[:, :, None] * (powers / below[:, None])[:, None]
    derivatives[:, :, 2] = np.stack([2.0 * x * y, r2 + 2.0 * y * y], axis=1)
    derivatives[:, :, 3] = np.stack([r2 + 2.0 * x * x, 2.0 * x * y], axis=1)
    if rest:
        derivatives[:, :, 5:] = -at[:, :, None] * (powers * (gain / below)[:, None])[:, None]
    return plane, derivatives


def _angle(points: Array) -> tuple[Array, Array]:
    """Angles (N,) to the axis, and unit directions (N, 2) from it in the image."""
    from_axis = np.sqrt(points[:, 0] ** 2 + points[:, 1] ** 2 + _TINY)
    return np.arctan2(from_axis, points[:, 2]), points[:, :2] / from_axis[:, None]


_ROUNDS = 4  # of weights; the scale of the errors is found anew before each
_STEPS = 40
_CONVERGED = 1e-9  # share of the cost
_LOST_PX = 1e3  # the error of a point that the lens cannot see
_FIRST_SCALE_PX = 5.0
_LEAST_SCALE_PX = 0.02
_TAIL = 3.0  # of the errors' scale: what is farther off counts a half or less
_MAD = 1.4826 / 1.1774  # a median of lengths in the plane to the standard deviation along one axis


@dataclass(frozen=True)
class LensFit:
    """A lens, and where the board was.

    Attributes:
        camera: the lens.
        views: the pictures that it was fitted to.
        poses: (V, 4, 4) camera_T_board of each.
        residuals: (N, 2) [px] of all points, picture by picture; measured minus projected.
        rows: (N,) picture of each point.
    """

    camera: CameraModel
    views: tuple[BoardView, ...]
    poses: Array
    residuals: Array
    rows: NDArray[np.int64]

    @cached_property
    def errors_px(self) -> Array:
        """(N,) lengths of the residuals."""
        errors: Array = np.linalg.norm(self.residuals, axis=1)
        return errors

    @property
    def median_px(self) -> float:
        """Median error of a point [px]."""
        return float(np.median(self.errors_px))

    @property
    def pixels(self) -> Array:
        """(N, 2) of all points."""
        return np.concatenate([view.pixels for view in self.views])

    @property
    def spreads(self) -> Array:
        """(N,) of all points."""
        return np.concatenate([view.spreads for view in self.views])


def with_lens(camera: CameraModel, lens: Array) -> CameraModel:
    """A camera of the same kind with other numbers (fx, fy, cx, cy, distortion)."""
    fx, fy, cx, cy, *distortion = lens.tolist()
    return type(camera)(camera.name, camera.width, camera.height, fx, fy, cx, cy, tuple(distortion))


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
    bundle = _Bundle(camera, views, fixed)
    lens = lens_numbers(camera)
    errors = bundle.residuals(lens, poses)
    scale = _FIRST_SCALE_PX
    for _ in range(rounds):
        scale = min(scale, _TAIL * max(_LEAST_SCALE_PX, _scale(np.linalg.norm(errors, axis=1))))
        lens, poses, errors = bundle.descend(lens, poses, errors, max(scale, _TAIL * _LEAST_SCALE_PX))
    return LensFit(with_lens(camera, lens), tuple(views), poses, -errors * bundle.spreads[:, None], bundle.rows)


def _scale(errors: Array) -> float:
    return _MAD * float(np.median(errors)) if len(errors) else 0.0


class _Bundle:
    """What is fitted to what."""

    def __init__(self, camera: CameraModel, views: Sequence[BoardView], fixed: bool) -> None:
        self._camera = camera
        self._points = np.concatenate([view.points_board for view in views])
        self._pixels = np.concatenate([view.pixels for view in views])
        self.spreads = np.concatenate([view.spreads for view in views])
        counts = [len(view.pixels) for view in views]
        self.rows = np.repeat(np.arange(len(views)), counts)
        self._starts = np.concatenate([[0], np.cumsum(counts)[:-1]])
        self._fixed = fixed

    def residuals(self, lens: Array, poses: Array) -> Array:
        """(N, 2) projected minus measured [px], over the point's spread."""
        projected, valid = with_lens(self._camera, lens).project(self._in_camera(poses))
        errors: Array = np.where(valid[:, None], projected - self._pixels, _LOST_PX) / self.spreads[:, None]
        return errors

    def descend(self, lens: Array, poses: Array, errors: Array, scale: float) -> tuple[Array, Array, Array]:
        """Lens, poses and residuals at the least cost."""
        damping, cost = 1e-3, _cost(errors, scale)
        for _ in range(_STEPS):
            system = self._system(lens, poses, errors, scale)
            while damping < 1e8:
                lens_step, pose_steps = system.solved(damping)
                new_lens, new_poses = lens + lens_step, _moved(poses, pose_steps)
                if _possible(new_lens, self._camera):
                    new_errors = self.residuals(new_lens, new_poses)
                    new_cost = _cost(new_errors, scale)
                    if new_cost < cost:
                        break
                damping *= 10.0
            else:
                break
            gain = (cost - new_cost) / cost
            lens, poses, errors, cost = new_lens, new_poses, new_errors, new_cost
            damping = max(1e-12, 0.1 * damping)
            if gain < _CONVERGED:
                break
        return lens, poses, errors

    def _in_camera(self, poses: Array) -> Array:
        turned: Array = np.einsum("nij,nj->ni", poses[self.rows, :3, :3], self._points)
        return turned + poses[self.rows, :3, 3]

    def _system(self, lens: Array, poses: Array, errors: Array, scale: float) -> "_System":
        camera = with_lens(self._camera, lens)
        points = self._in_camera(poses)
        _, by_point, valid = camera.project_with_jacobian(points)
        by_point = np.where(valid[:, None, None], by_point, 0.0)
        by_pose = np.concatenate([-by_point @ hat(points), by_point], axis=2)
        of_lens = np.zeros((len(points), 2, len(lens)))
        if not self._fixed:
            of_lens = np.where(valid[:, None, None], derivatives_by_lens(camera, points), 0.0)
        weights = 1.0 / (1.0 + np.sum(errors**2, axis=1) / scale**2)
        by_pose, of_lens = (by / self.spreads[:, None, None] for by in (by_pose, of_lens))
        poses_weighted, lens_weighted = (by * weights[:, None, None] for by in (by_pose, of_lens))
        return _System(
            np.add.reduceat(np.einsum("nki,nkj->nij", poses_weighted, by_pose), self._starts, axis=0),
            np.add.reduceat(np.einsum("nki,nkj->nij", poses_weighted, of_lens), self._starts, axis=0),
            np.einsum("nki,nkj->ij", lens_weighted, of_lens),
            np.add.reduceat(np.einsum("nki,nk->ni", poses_weighted, errors), self._starts, axis=0),
            np.einsum("nki,nk->i", lens_weighted, errors),
        )


@dataclass(frozen=True)
class _System:
    """Normal equations: of poses (V, 6, 6), between these and the lens (V, 6, L), of the lens (L, L); right sides."""

    poses: Array
    between: Array
    lens: Array
    right_poses: Array
    right_lens: Array

    def solved(self, damping: float) -> tuple[Array, Array]:
        """Changes of the lens (L,) and of the poses (V, 6)."""
        damped = self.poses + damping * _diagonals(self.poses) + 1e-12 * np.eye(6)
        carried = np.linalg.solve(damped, np.concatenate([self.between, self.right_poses[:, :, None]], axis=2))
        if not self.lens.any():  # it is fixed
            return np.zeros(len(self.lens)), -carried[:, :, -1]
        across, along = carried[:, :, :-1], carried[:, :, -1]
        reduced = self.lens + damping * np.diag(np.diag(self.lens)) - np.einsum("vij,vik->jk", self.between, across)
        wanted = self.right_lens - np.einsum("vij,vi->j", self.between, along)
        # Scaled, since focal lengths are hundreds and coefficients may be thousandths.
        size = 1.0 / np.sqrt(np.maximum(np.diag(self.lens), 1e-12))
        of_lens = -size * np.linalg.lstsq(reduced * size * size[:, None], wanted * size, rcond=1e-13)[0]
        return of_lens, -(along + across @ of_lens)


def _diagonals(matrices: Array) -> Array:
    return matrices * np.eye(matrices.shape[-1])


def _moved(poses: Array, steps: Array) -> Array:
    """Poses (V, 4, 4) turned and shifted in the camera frame by steps (V, 6)."""
    turns = exp_so3(steps[:, :3])
    moved = turns @ poses[:, :3]
    moved[:, :, 3] += steps[:, 3:]
    return rigid(moved[:, :, :3], moved[:, :, 3])


def _cost(errors: Array, scale: float) -> float:
    return float(np.log1p(np.sum(errors**2, axis=1) / scale**2).sum())


def _possible(lens: Array, camera: CameraModel) -> bool:
    """Whether a camera may have these numbers."""
    largest = 20.0 * max(camera.width, camera.height)
    if not (np.isfinite(lens).all() and (lens[:2] > 1.0).all() and (lens[:2] < largest).all()):
        return False
    return camera.distortion_model != "fov" or 0.0 <= lens[4] < np.pi - 0.01


_FOCAL_OF_WIDTH = np.geomspace(0.18, 3.0, 22)
_TRIED = 12  # pictures that focal lengths are tried on
_MIN_VIEWS = 3
_ANGLES = 60
_LARGEST = 100.0  # coefficient of a lens to start from
_STEEPEST_DEG = 80.0  # beyond it a perspective image is useless


def initial_fit(views: Sequence[BoardView], width: int, height: int) -> LensFit:
    """An equidistant lens with the pictures' poses: with its four coefficients it resembles any lens.

    Raises:
        LensError: no lens explains the pictures.
    """
    most_points = sorted(views, key=lambda view: -len(view.pixels))
    tried = most_points[: 3 * _TRIED : 3] if len(views) >= 3 * _TRIED else most_points[:_TRIED]
    costs = [_start_cost(_plain(focal * max(width, height), width, height), tried) for focal in _FOCAL_OF_WIDTH]
    camera = _plain(float(_FOCAL_OF_WIDTH[int(np.argmin(costs))]) * max(width, height), width, height)
    return fit_unplaced(camera, views)


def fit_unplaced(camera: CameraModel, views: Sequence[BoardView], rounds: int = 4) -> LensFit:
    """Fit a lens that is roughly known to pictures whose poses are not.

    Raises:
        LensError: fewer than three of them can be placed by it.
    """
    placed = [(view, found[0]) for view in views if (found := board_pose(camera, view)) is not None]
    if len(placed) < _MIN_VIEWS:
        raise LensError(
            f"{len(placed)} of {len(views)} pictures fit any lens, {_MIN_VIEWS} are needed: is it the board's own "
            "file, with its counts and sizes?"
        )
    return fit_lens(camera, [view for view, _ in placed], np.array([pose for _, pose in placed]), rounds=rounds)


def as_model(model: str, fit: LensFit) -> CameraModel:
    """A camera of another model that resembles a fitted one out to where that saw the board."""
    camera = fit.camera
    if model == camera.distortion_model:
        return camera
    rays, valid = camera.unproject(fit.pixels)
    widest = float(np.arccos(np.clip(rays[valid][:, 2].min(), -1.0, 1.0)))
    if model in ("plumb_bob", "rational_polynomial"):
        widest = min(widest, np.radians(_STEEPEST_DEG))
    angles = np.linspace(0.0, widest, _ANGLES)[1:]
    points = np.column_stack([np.sin(angles), np.zeros_like(angles), np.cos(angles)])
    radii = (camera.project(points)[0][:, 0] - camera.cx) / camera.fx
    scale, distortion = _resembling(model, angles, radii)
    k = [scale * camera.fx, 0.0, camera.cx, 0.0, scale * camera.fy, camera.cy, 0.0, 0.0, 1.0]
    return camera_from_info(camera.name, camera.width, camera.height, model, distortion, k)


def _resembling(model: str, angles: Array, radii: Array) -> tuple[float, list[float]]:
    """Scale of the focal length and coefficients of a model whose radii (N,) at angles (N,) are these."""
    if model == "fov":
        trials = []
        for omega in np.linspace(0.02, 2.8, 140).tolist():
            shape = np.arctan2(2.0 * np.tan(0.5 * omega) * np.sin(angles), np.cos(angles)) / omega
            scale = float(shape @ radii / (shape @ shape))
            trials.append((float(np.abs(scale * shape - radii).max()), scale, omega))
        _, scale, omega = min(trials)
        return scale, [omega]
    x = np.tan(angles)
    gain = radii / x
    columns = np.column_stack([x**2, x**4, x**6])
    if model == "rational_polynomial":
        columns = np.column_stack([columns, -gain[:, None] * columns])
    size = np.linalg.norm(columns, axis=0)
    # Errors of the radius, not of the gain, are what pixels show.
    k = np.linalg.lstsq(columns / size * x[:, None], (gain - 1.0) * x, rcond=1e-6)[0] / size
    # Where the board was seen near the axis alone, anything explains the rest.
    k = k if np.abs(k).max() < _LARGEST else np.zeros(len(size))
    return 1.0, [k[0], k[1], 0.0, 0.0, *k[2:]]


def _plain(focal_px: float, width: int, height: int) -> CameraModel:
    k = [focal_px, 0.0, 0.5 * (width - 1), 0.0, focal_px, 0.5 * (height - 1), 0.0, 0.0, 1.0]
    return camera_from_info("camera", width, height, "equidistant", [0.0] * 4, k)


def _start_cost(camera: CameraModel, views: Sequence[BoardView]) -> float:
    """Mean of the pictures' median errors [px], those that cannot be placed counted as far off."""
    far = float(max(camera.width, camera.height))
    errors = [far if (found := board_pose(camera, view)) is None else min(far, found[1]) for view in views]
    return float(np.mean(errors))
