"""A picture of a board: which of its points it shows, and where the board was."""

from dataclasses import dataclass

import cv2
import numpy as np

from bodycam_ros.camera import CameraModel
from bodycam_ros.geometry import Array, rigid

_FLAT_M = 1e-9
_NARROW = 0.2  # cosine of the angle to the middle of the points, beyond which a perspective image of them is too wide
_LEAST_POINTS = 6


@dataclass(frozen=True)
class BoardSight:
    """The points of a board in one picture.

    Attributes:
        name: of the picture, for people.
        points_board: (N, 3) in the board frame [m].
        pixels: (N, 2) where they are.
        spreads: (N,) how uncertain a point is against the best: 1 or more.
        sharpness: steepest change from pixel to pixel, as a share of the board's contrast.
    """

    name: str
    points_board: Array
    pixels: Array
    spreads: Array
    sharpness: float


def board_pose(camera: CameraModel, sight: BoardSight) -> tuple[Array, float] | None:
    """camera_T_board (4, 4) and its median error [px] by a lens, or None where that sees too few points."""
    rays, valid = camera.unproject(sight.pixels)
    if valid.sum() < _LEAST_POINTS:
        return None
    middle = rays[valid].mean(axis=0)
    view_R_camera = turned_to(middle / np.linalg.norm(middle))
    rays_view = rays @ view_R_camera.T
    with np.errstate(invalid="ignore"):
        used = valid & (rays_view[:, 2] > _NARROW)
    if used.sum() < _LEAST_POINTS:
        return None
    image = rays_view[used, :2] / rays_view[used, 2:]
    points = sight.points_board[used]
    best = None
    for view_T_board in _perspective_poses(points, image):
        camera_T_board = rigid(view_R_camera.T, np.zeros(3)) @ view_T_board
        seen, in_view = camera.project(sight.points_board @ camera_T_board[:3, :3].T + camera_T_board[:3, 3])
        error = np.where(in_view, np.linalg.norm(seen - sight.pixels, axis=1), np.inf)
        median = float(np.median(error))
        if best is None or median < best[1]:
            best = camera_T_board, median
    return best if best is not None and np.isfinite(best[1]) else None


def _perspective_poses(points: Array, image: Array) -> list[Array]:
    """view_T_board (4, 4) of points (N, 3) at coordinates (N, 2) in the image plane: a flat board may have two."""
    is_flat = np.ptp(points[:, 2]) < _FLAT_M and abs(points[0, 2]) < _FLAT_M
    method = cv2.SOLVEPNP_IPPE if is_flat else cv2.SOLVEPNP_SQPNP
    try:
        _, turns, shifts, _ = cv2.solvePnPGeneric(points, image, np.eye(3), np.zeros(4), flags=method)
    except cv2.error:  # points on a line
        return []
    poses = [rigid(cv2.Rodrigues(r)[0], t.ravel()) for r, t in zip(turns, shifts, strict=True)]
    return [pose for pose in poses if np.isfinite(pose).all()]


def turned_to(direction: Array) -> Array:
    """view_R_camera (3, 3) of a view along a unit direction."""
    across = np.cross([0.0, 1.0, 0.0] if abs(direction[1]) < 0.9 else [1.0, 0.0, 0.0], direction)
    across /= np.linalg.norm(across)
    return np.array([across, np.cross(direction, across), direction])
