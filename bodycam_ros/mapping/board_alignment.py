"""The scale, origin and upward direction that an AprilTag board gives a map."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.boards.apriltag import TagView
from bodycam_ros.boards.board import Board
from bodycam_ros.camera import CameraModel
from bodycam_ros.errors import MapError
from bodycam_ros.geometry import Array, exp_so3, inverse, transform_points, umeyama
from bodycam_ros.mapping.photographs import wrong_camera
from bodycam_ros.mapping.structure import distinct
from bodycam_ros.mapping.triangulation import triangulate

_LEAST_SHOWN = 0.5  # share of the corners
_MOST_GROWTH = 10.0  # logarithm of the scale by which the board's first estimate is off; beyond it nothing fits

_MIN_CORNERS = 4  # one tag
_MIN_ANGLE = 1e-3  # [rad] between the rays of a corner
_CORNER_NOISE_PX = 0.05  # of a large tag, as measured; errors beyond twice it count linearly
_LARGE_BREADTH_PX = 50.0  # below it a tag's noise grows with the square, as measured
_MAX_CORNER_ERROR_PX = 2.0  # views of a corner beyond it are outliers of its triangulation
_MAX_MISFIT_MRAD = 1.2  # median error of the corners beyond which there is no map; 0.05 to 1.0 with the right
# camera.yaml, 1.3 and more with another lens model or a focal length 20 % off
_FINE_MISFIT_PX = 0.5  # median error that is never refused: a fisheye's pixels are wider than the limit above

# Corners run from the upper left clockwise: where they lie along a tag's width and height.
_WIDTH_SIGNS = np.array([[-1.0], [1.0], [1.0], [-1.0]])
_HEIGHT_SIGNS = np.array([[-1.0], [-1.0], [1.0], [1.0]])


@dataclass(frozen=True)
class BoardResidual:
    """How well the board fits the photographs after the alignment.

    Attributes:
        views_of_tag: tag -> number of photographs that measure it.
        rms_of_tag_px: tag -> root mean square distance of its corners from where the board projects [px].
        rms_px: the same over all tags.
        rms_mm: root mean square distance of triangulated corners from the board's [mm].
        median_px: median of the distances in the photographs, which a single wrong tag does not move.
        inset_px: how far blur moves each edge inwards; estimated with the alignment [px].
    """

    views_of_tag: Mapping[int, int]
    rms_of_tag_px: Mapping[int, float]
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


@dataclass(frozen=True)
class _TagViews:
    """V views of tags of the board.

    Attributes:
        tags: (V,) numbers.
        corners_board: (V, 4, 3) [m].
        pixels: (V, 4, 2) of the corners.
        breadths: (V, 2) of the tag in the photograph [px]; see ``TagView``.
        camera_T_world: (V, 4, 4) of the photograph.
        by_camera: each camera with the rows that it took.
        focal_px: (V,) focal length of that camera [px], by which pixels become angles.
    """

    tags: NDArray[np.int64]
    corners_board: Array
    pixels: Array
    breadths: Array
    camera_T_world: Array
    by_camera: tuple[tuple[CameraModel, NDArray[np.int64]], ...]
    focal_px: Array


def align_to_board(
    world_T_camera: Array,
    tag_views: Sequence[Sequence[TagView]],
    taken_by: Sequence[CameraModel],
    board: Board,
) -> BoardAlignment:
    """Find the similarity that puts a structure on its board.

    Args:
        world_T_camera: (K, 4, 4) poses of the registered photographs, in any frame and scale.
        tag_views: for each of them the tags that it shows; those of other boards are ignored.
        taken_by: the camera of each of them.
        board: what was printed.

    Raises:
        MapError: too few views of the board to place it, or it does not fit, as with the intrinsics of another camera.
    """
    views = _collect(world_T_camera, tag_views, taken_by, board)
    board_points, world_points = _triangulate_corners(views)
    if len(board_points) < _MIN_CORNERS:
        raise MapError(
            f"board: only {len(board_points)} of its corners can be placed from {len(tag_views)} registered "
            "photographs; take more photographs of it from different sides, near enough that a tag is 30 px or "
            f"broader. If there are enough: {wrong_camera(*distinct(taken_by)[0])}"
        )
    scale, R, t, inset_px = _refine(views, *umeyama(board_points, world_points, with_scale=True))
    errors_px = np.linalg.norm(_residuals(views, scale, R, t, inset_px), axis=2)
    offsets_m = (world_points - t) @ R / scale - board_points
    tags = np.unique(views.tags).tolist()
    residual = BoardResidual(
        views_of_tag={tag: int(np.sum(views.tags == tag)) for tag in tags},
        rms_of_tag_px={tag: _rms(errors_px[views.tags == tag]) for tag in tags},
        rms_px=_rms(errors_px),
        rms_mm=1e3 * _rms(np.linalg.norm(offsets_m, axis=1)),
        median_px=float(np.median(errors_px)),
        inset_px=inset_px,
    )
    # An angle, since pixels are finer in larger photographs.
    misfit_mrad = 1e3 * float(np.median(errors_px / views.focal_px[:, None]))
    # A fit to corners that contradict each other may end with the board behind the cameras, where nothing is off.
    shown = np.isfinite(_residuals(views, scale, R, t, inset_px, where_unseen=np.inf)).all(axis=2)
    if np.mean(shown) < _LEAST_SHOWN:
        raise MapError(
            f"board: at its best pose only {np.mean(shown):.0%} of its corners are in view of the photographs in which "
            f"they were detected. Check that board.yaml is of this board. {wrong_camera(*distinct(taken_by)[0])}"
        )
    if misfit_mrad > _MAX_MISFIT_MRAD and residual.median_px > _FINE_MISFIT_PX:
        raise MapError(
            f"board: its corners are {residual.median_px:.1f} px ({misfit_mrad:.1f} mrad, median) from where the "
            f"photographs should show them, expected {_MAX_MISFIT_MRAD:g} mrad at most. "
            f"{wrong_camera(*distinct(taken_by)[0])} If it does, board.yaml may describe another board"
        )
    map_R_board = np.eye(3) if board.map_R_board is None else board.map_R_board
    map_R_world = map_R_board @ R.T
    return BoardAlignment(1.0 / scale, map_R_world, -map_R_world @ t / scale, map_R_board, residual)


def _collect(
    world_T_camera: Array, tag_views: Sequence[Sequence[TagView]], taken_by: Sequence[CameraModel], board: Board
) -> _TagViews:
    rows = [
        (view, pose, camera)
        for pose, views, camera in zip(inverse(world_T_camera), tag_views, taken_by, strict=True)
        for view in views
        if view.tag in board.corners_board
    ]
    if not rows:
        raise MapError(
            f"board: none of its tags ({board.family}: {', '.join(map(str, board.corners_board))}) is seen in the "
            "registered photographs; photograph it from near by, or leave the board out for a map without scale"
        )
    views, poses, cameras = zip(*rows, strict=True)
    different, camera_of_view = distinct(cameras)
    return _TagViews(
        tags=np.array([view.tag for view in views]),
        corners_board=np.array([board.corners_board[view.tag] for view in views]),
        pixels=np.array([view.corners for view in views]),
        breadths=np.array([view.breadths for view in views]),
        camera_T_world=np.array(poses),
        by_camera=tuple((camera, np.flatnonzero(camera_of_view == row)) for row, camera in enumerate(different)),
        focal_px=np.array([camera.fx for camera in cameras]),
    )


def _triangulate_corners(views: _TagViews) -> tuple[Array, Array]:
    """Corners (N, 3) of the board and in the world, each from all photographs that agree on it."""
    bearings = np.empty((len(views.tags), 4, 3))
    for camera, at in views.by_camera:
        bearings[at] = camera.unproject(views.pixels[at].reshape(-1, 2))[0].reshape(-1, 4, 3)
    world_T_camera = inverse(views.camera_T_world)
    centres = world_T_camera[:, :3, 3]
    directions = bearings @ np.swapaxes(world_T_camera[:, :3, :3], 1, 2)
    on_board, in_world = [], []
    for tag in np.unique(views.tags):
        for corner in range(4):
            kept = np.flatnonzero(views.tags == tag)
            while len(kept) >= 2:
                found = triangulate(centres[None, kept], directions[None, kept, corner], views.focal_px[None, kept])
                worst = int(found.errors_px[0].argmax())
                if found.errors_px[0, worst] <= _MAX_CORNER_ERROR_PX:
                    if found.angles[0] > _MIN_ANGLE:
                        on_board.append(views.corners_board[kept[0], corner])
                        in_world.append(found.points[0])
                    break
                kept = np.delete(kept, worst)
    return np.array(on_board).reshape(-1, 3), np.array(in_world).reshape(-1, 3)


def _refine(views: _TagViews, scale: float, R: Array, t: Array) -> tuple[float, Array, Array, float]:
    """Least squares of the corners' pixels over the board's seven parameters and the inset of the tags' edges.

    The inset shows in the gaps between tags, which blur widens as much as it shrinks the tags.
    """
    from scipy.optimize import least_squares

    def unpack(x: Array) -> tuple[float, Array, Array, float]:
        return (
            scale * float(np.exp(np.clip(x[0], -_MOST_GROWTH, _MOST_GROWTH))),
            R @ exp_so3(x[1:4]),
            t + scale * x[4:7],
            float(x[7]),
        )

    growth = np.maximum(1.0, _LARGE_BREADTH_PX / views.breadths.min(axis=1)) ** 2
    noise = _CORNER_NOISE_PX * growth[:, None, None]

    def cost(x: Array) -> Array:
        weighted: Array = _residuals(views, *unpack(x)) / noise
        return weighted.ravel()

    solution = least_squares(cost, np.zeros(8), loss="huber", f_scale=2.0, x_scale="jac")
    return unpack(solution.x)


def _residuals(views: _TagViews, scale: float, R: Array, t: Array, inset_px: float, where_unseen: float = 0.0) -> Array:
    """Pixels (V, 4, 2) from where the board projects, its tags shrunk by the inset, to where the corners were found.

    ``where_unseen`` stands for those that a camera could not show.
    """
    # A corner is its tag's centre and half of its width and height, exactly for any parallelogram.
    corners = views.corners_board
    shrink = (1.0 - 2.0 * inset_px / views.breadths)[:, :, None, None]
    points_board = corners.mean(axis=1, keepdims=True)
    for column, signs in enumerate((_WIDTH_SIGNS, _HEIGHT_SIGNS)):
        points_board = points_board + shrink[:, column] * signs * (signs * corners).mean(axis=1, keepdims=True)
    points_camera = transform_points(views.camera_T_world, scale * points_board @ R.T + t)
    residuals = np.zeros_like(views.pixels)
    for camera, rows in views.by_camera:
        projected, valid = camera.project(points_camera[rows].reshape(-1, 3))
        errors = views.pixels[rows] - projected.reshape(-1, 4, 2)
        residuals[rows] = np.where(valid.reshape(-1, 4, 1), errors, where_unseen)
    return residuals


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))
