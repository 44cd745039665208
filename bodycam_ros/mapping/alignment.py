"""Scale, origin and upward direction of a structure from its views of an AprilTag board."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.errors import MapError
from bodycam_ros.geometry import exp_so3, transform_points, umeyama
from bodycam_ros.mapping.apriltag import TagView
from bodycam_ros.mapping.board import Board, CornerViews, collect_corners, triangulate_corners
from bodycam_ros.mapping.photographs import wrong_camera
from bodycam_ros.mapping.structure import distinct

Array = NDArray[np.float64]

_MIN_CORNERS = 4  # one tag
_CORNER_NOISE_PX = 0.05  # of a large tag, as measured; errors beyond twice it count linearly
_LARGE_BREADTH_PX = 50.0  # below it a tag's noise grows with the square, as measured
_MAX_CORNER_ERROR_PX = 2.0  # views of a corner beyond it are outliers of its triangulation
_MAX_MISFIT_MRAD = 1.2  # median error of the corners beyond which there is no map; 0.05 to 1.0 with the right
# camera.yaml, 1.3 and more with another lens model or a focal length 20 % off
_FINE_MISFIT_PX = 0.5  # median error that is never refused: a fisheye's pixels are wider than the limit above


@dataclass(frozen=True)
class BoardResidual:
    """How well the board fits the photographs after the alignment.

    Attributes:
        views_of_tag: tag -> number of photographs that measure it.
        rms_of_tag_px: tag -> root mean square distance of its corners from where the board projects [px].
        rms_of_tag_mm: tag -> root mean square distance of its triangulated corners from the board's [mm].
        rms_px, rms_mm: the same over all tags.
        median_px: median of those distances in the photographs, which a single wrong tag does not move.
        inset_px: how far blur moves each edge inwards; estimated with the alignment [px].
    """

    views_of_tag: Mapping[int, int]
    rms_of_tag_px: Mapping[int, float]
    rms_of_tag_mm: Mapping[int, float]
    rms_px: float
    rms_mm: float
    median_px: float
    inset_px: float


@dataclass(frozen=True)
class BoardAlignment:
    """Similarity from the frame of the structure to the frame of the map: x -> scale R x + t [m].

    The map's origin is the board's; ``map_R_board`` (3, 3) turns the board's axes to the map's.
    """

    scale: float
    R: Array
    t: Array
    map_R_board: Array
    residual: BoardResidual


def align_to_board(
    world_T_camera: Array,
    tag_views: Sequence[Sequence[TagView]],
    taken_by: Sequence[CameraModel],
    board: Board,
) -> BoardAlignment:
    """Find the similarity that puts a structure on its board.

    Args:
        world_T_camera: (K, 4, 4) poses of the registered photographs, in any frame and scale.
        tag_views: for each of them the tags that it shows.
        taken_by: the camera of each of them.
        board: what was printed.

    Raises:
        MapError: too few views of the board to place it, or it does not fit, as with the intrinsics of another camera.
    """
    views = collect_corners(world_T_camera, tag_views, taken_by, board)
    triangulated = triangulate_corners(views, _MAX_CORNER_ERROR_PX)
    seen = list(triangulated)
    if len(seen) < _MIN_CORNERS:
        raise MapError(
            f"board: only {len(seen)} of its corners can be placed from {len(tag_views)} registered photographs; "
            "take more photographs of it from different sides, near enough that a tag is 30 px or broader. If there "
            f"are enough: {wrong_camera(*distinct(taken_by)[0])}"
        )
    world_points = np.array([triangulated[row] for row in seen])
    board_points = np.concatenate(list(board.corners_board.values()))[seen]
    scale, R, t = umeyama(board_points, world_points, with_scale=True)
    scale, R, t, inset_px = _refine(views, scale, R, t)
    residuals = _residuals(views, scale, R, t, inset_px)
    offsets = (world_points - t) @ R / scale - board_points
    residual = _report(views, residuals, np.array(seen), offsets, inset_px)
    # An angle, since pixels are finer in larger photographs.
    misfit_mrad = 1e3 * float(np.median(np.linalg.norm(residuals, axis=1) / views.focal_px))
    if misfit_mrad > _MAX_MISFIT_MRAD and residual.median_px > _FINE_MISFIT_PX:
        raise MapError(
            f"board: its corners are {residual.median_px:.1f} px ({misfit_mrad:.1f} mrad, median) from where the "
            f"photographs should show them, expected {_MAX_MISFIT_MRAD:g} mrad at most. "
            f"{wrong_camera(*distinct(taken_by)[0])} If it does, board.yaml may describe another board"
        )
    map_R_board = np.eye(3) if board.map_R_board is None else board.map_R_board
    map_R_world = map_R_board @ R.T
    return BoardAlignment(1.0 / scale, map_R_world, -map_R_world @ t / scale, map_R_board, residual)


def _refine(views: CornerViews, scale: float, R: Array, t: Array) -> tuple[float, Array, Array, float]:
    """Least squares of the corners' pixels over the board's seven parameters and the inset of the tags' edges.

    The inset shows in the gaps between tags, which blur widens as much as it shrinks the tags.
    """
    from scipy.optimize import least_squares

    def unpack(x: Array) -> tuple[float, Array, Array, float]:
        return scale * float(np.exp(x[0])), R @ exp_so3(x[1:4]), t + scale * x[4:7], float(x[7])

    growth = np.maximum(1.0, _LARGE_BREADTH_PX / views.breadths.min(axis=1)) ** 2
    noise = _CORNER_NOISE_PX * growth[:, None]

    def cost(x: Array) -> Array:
        weighted: Array = _residuals(views, *unpack(x)) / noise
        return weighted.ravel()

    solution = least_squares(cost, np.zeros(8), loss="huber", f_scale=2.0, x_scale="jac")
    return unpack(solution.x)


def _residuals(views: CornerViews, scale: float, R: Array, t: Array, inset_px: float) -> Array:
    """Pixels (N, 2) from where the board projects, its tags shrunk by the inset, to where the corners were found."""
    shrink = 1.0 - 2.0 * inset_px / views.breadths[:, :, None]
    points_board = views.centre_board + shrink[:, 0] * views.half_width_board + shrink[:, 1] * views.half_height_board
    points_camera = transform_points(views.camera_T_world, (scale * points_board @ R.T + t)[:, None])[:, 0]
    residuals = np.zeros_like(views.pixels)
    for camera, rows in views.by_camera:
        projected, valid = camera.project(points_camera[rows])
        residuals[rows[valid]] = (views.pixels[rows] - projected)[valid]
    return residuals


def _report(
    views: CornerViews, residuals: Array, corner_rows: NDArray[np.int64], offsets: Array, inset_px: float
) -> BoardResidual:
    squares_px = np.sum(residuals**2, axis=1)
    squares_mm = np.sum((1e3 * offsets) ** 2, axis=1)
    tags = np.unique(views.tags).tolist()
    tag_of_corner = {int(row): int(tag) for row, tag in zip(views.corner_rows, views.tags, strict=True)}
    corner_tags = np.array([tag_of_corner[row] for row in corner_rows.tolist()])
    return BoardResidual(
        views_of_tag={tag: int(np.sum(views.tags == tag)) // 4 for tag in tags},
        rms_of_tag_px={tag: float(np.sqrt(squares_px[views.tags == tag].mean())) for tag in tags},
        rms_of_tag_mm={
            tag: float(np.sqrt(squares_mm[corner_tags == tag].mean())) for tag in tags if np.any(corner_tags == tag)
        },
        rms_px=float(np.sqrt(squares_px.mean())),
        rms_mm=float(np.sqrt(squares_mm.mean())),
        median_px=float(np.sqrt(np.median(squares_px))),
        inset_px=inset_px,
    )
