"""A first lens, of pictures of a board alone."""

from collections.abc import Sequence

import numpy as np

from bodycam_ros.camera import CameraModel, camera_from_info
from bodycam_ros.errors import LensError
from bodycam_ros.geometry import Array
from bodycam_ros.lens.board_sight import BoardSight, board_pose
from bodycam_ros.lens.lens_fit import LensFit, fit_lens

MODELS = ("fov", "equidistant", "plumb_bob", "rational_polynomial")
"""From few numbers to many."""

_FOCAL_OF_WIDTH = np.geomspace(0.18, 3.0, 22)
_TRIED = 12  # pictures that focal lengths are tried on
_LEAST_SIGHTS = 4
_ANGLES = 60
_LARGEST = 100.0  # coefficient of a lens to start from
_STEEPEST_DEG = 80.0  # beyond it a perspective image says nothing


def first_fit(sights: Sequence[BoardSight], width: int, height: int) -> LensFit:
    """An equidistant lens with the pictures' poses: with its four coefficients it resembles any lens.

    Raises:
        LensError: no lens explains the pictures.
    """
    most_points = sorted(sights, key=lambda sight: -len(sight.pixels))
    tried = most_points[: 3 * _TRIED : 3] if len(sights) >= 3 * _TRIED else most_points[:_TRIED]
    costs = [_cost(_plain(focal * max(width, height), width, height), tried) for focal in _FOCAL_OF_WIDTH]
    camera = _plain(float(_FOCAL_OF_WIDTH[int(np.argmin(costs))]) * max(width, height), width, height)
    return placed_fit(camera, sights)


def placed_fit(camera: CameraModel, sights: Sequence[BoardSight], rounds: int = 4) -> LensFit:
    """Fit a lens that is roughly known to pictures whose poses are not.

    Raises:
        LensError: fewer than four of them can be placed by it.
    """
    placed = [(sight, found[0]) for sight in sights if (found := board_pose(camera, sight)) is not None]
    if len(placed) < _LEAST_SIGHTS:
        raise LensError(f"{len(placed)} of {len(sights)} pictures of the board can be explained by a lens; film more")
    return fit_lens(camera, [sight for sight, _ in placed], np.array([pose for _, pose in placed]), rounds=rounds)


def as_model(model: str, fit: LensFit) -> CameraModel:
    """A camera of another model that resembles a fitted one out to where that saw the board."""
    camera = fit.camera
    if model == camera.distortion_model:
        return camera
    rays, valid = camera.unproject(fit.pixels)
    widest = float(np.arccos(np.clip(rays[valid][:, 2].min(), -1.0, 1.0)))
    angles = np.linspace(0.0, widest, _ANGLES)[1:]
    points = np.column_stack([np.sin(angles), np.zeros_like(angles), np.cos(angles)])
    seen, _ = camera.project(points)
    radii = (seen[:, 0] - camera.cx) / camera.fx
    if model == "fov":
        scale, distortion = _fov_of(angles, radii)
    else:
        scale, distortion = _perspective_of(model, angles, radii)
    k = [scale * camera.fx, 0.0, camera.cx, 0.0, scale * camera.fy, camera.cy, 0.0, 0.0, 1.0]
    return camera_from_info(camera.name, camera.width, camera.height, model, distortion, k)


def _fov_of(angles: Array, radii: Array) -> tuple[float, list[float]]:
    """Scale of the focal length, and omega, the best of a row of them."""
    best = (np.inf, 1.0, 0.5)
    for omega in np.linspace(0.02, 2.8, 140).tolist():
        shape = np.arctan2(2.0 * np.tan(0.5 * omega) * np.sin(angles), np.cos(angles)) / omega
        scale = float(shape @ radii / (shape @ shape))
        best = min(best, (float(np.abs(scale * shape - radii).max()), scale, omega))
    return best[1], [best[2]]


def _perspective_of(model: str, angles: Array, radii: Array) -> tuple[float, list[float]]:
    """Radial coefficients by linear least squares; the focal length is that of the middle."""
    near = angles < np.radians(_STEEPEST_DEG)
    x = np.tan(angles[near])
    x2 = x * x
    gain = radii[near] / x
    # Errors of the radius, not of the gain, are what pixels show.
    if model == "plumb_bob":
        k = _least_squares(np.column_stack([x2, x2**2, x2**3]), gain - 1.0, x)
        return 1.0, [k[0], k[1], 0.0, 0.0, k[2]]
    k = _least_squares(np.column_stack([x2, x2**2, x2**3, -gain * x2, -gain * x2**2, -gain * x2**3]), gain - 1.0, x)
    return 1.0, [k[0], k[1], 0.0, 0.0, *k[2:]]


def _least_squares(columns: Array, wanted: Array, weights: Array) -> list[float]:
    size = np.linalg.norm(columns, axis=0)
    solved = np.linalg.lstsq(columns / size * weights[:, None], wanted * weights, rcond=1e-6)[0] / size
    # Where the board was seen near the axis alone, anything explains the rest.
    found: list[float] = solved.tolist() if np.abs(solved).max() < _LARGEST else [0.0] * len(size)
    return found


def _plain(focal_px: float, width: int, height: int) -> CameraModel:
    k = [focal_px, 0.0, 0.5 * (width - 1), 0.0, focal_px, 0.5 * (height - 1), 0.0, 0.0, 1.0]
    return camera_from_info("camera", width, height, "equidistant", [0.0] * 4, k)


def _cost(camera: CameraModel, sights: Sequence[BoardSight]) -> float:
    """Mean of the pictures' median errors [px], those that cannot be placed counted as far off."""
    far = float(max(camera.width, camera.height))
    errors = [far if (found := board_pose(camera, sight)) is None else min(far, found[1]) for sight in sights]
    return float(np.mean(errors))
