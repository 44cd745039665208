"""Scale, origin and upward direction of a structure from its views of an AprilTag board."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from bodycam_ros.camera import CameraModel
from bodycam_ros.errors import MapError
from bodycam_ros.geometry import exp_so3, inverse, transform_points, umeyama
from bodycam_ros.mapping.apriltag import TagView
from bodycam_ros.mapping.board import Board
from bodycam_ros.settings import setting

Array = NDArray[np.float64]

_MIN_CORNERS = 4  # one tag
# Corners run from the upper left clockwise: where they lie along a tag's width and height.
_WIDTH_SIGNS = np.array([[-1.0], [1.0], [1.0], [-1.0]])
_HEIGHT_SIGNS = np.array([[-1.0], [-1.0], [1.0], [1.0]])


@dataclass(frozen=True)
class AlignmentSettings:
    """How the board's corners are placed in the structure."""

    corner_noise: float = setting(
        0.05, unit="px", limits=(0.01, 5.0), reason="of a corner of a large tag, as measured; twice it counts linearly"
    )
    large_breadth: float = setting(
        50.0,
        unit="px",
        limits=(5.0, 500.0),
        reason="breadth below which a tag's noise grows with the square, as measured",
    )
    max_corner_error: float = setting(
        2.0,
        unit="px",
        limits=(0.2, 50.0),
        reason="views of a corner beyond it are left out when the corner is triangulated",
    )


@dataclass(frozen=True)
class BoardResidual:
    """How well the board fits the photographs after the alignment.

    Attributes:
        views_of_tag: tag -> number of photographs that measure it.
        rms_of_tag_px: tag -> root mean square distance of its corners from where the board projects [px].
        rms_of_tag_mm: tag -> root mean square distance of its triangulated corners from the board's [mm].
        rms_px, rms_mm: the same over all tags.
        inset_px: how far blur moves each edge inwards; estimated with the alignment [px].
    """

    views_of_tag: Mapping[int, int]
    rms_of_tag_px: Mapping[int, float]
    rms_of_tag_mm: Mapping[int, float]
    rms_px: float
    rms_mm: float
    inset_px: float


@dataclass(frozen=True)
class BoardAlignment:
    """Similarity from the frame of the structure to the frame of the map: x -> scale R x + t [m]."""

    scale: float
    R: Array
    t: Array
    residual: BoardResidual


@dataclass(frozen=True)
class _Corners:
    """All views of board corners, one per row.

    A corner is its tag's centre plus half of the tag's width and half of its height, each with the corner's sign.
    """

    camera_T_world: Array
    pixels: Array
    bearings: Array
    centre_board: Array
    half_width_board: Array
    half_height_board: Array
    breadths: Array
    tags: NDArray[np.int64]
    corner_rows: NDArray[np.int64]


def align_to_board(
    world_T_camera: Array,
    tag_views: Sequence[Sequence[TagView]],
    camera: CameraModel,
    board: Board,
    settings: AlignmentSettings,
) -> BoardAlignment:
    """Find the similarity that puts a structure on its board.

    Args:
        world_T_camera: (K, 4, 4) poses of the registered photographs, in any frame and scale.
        tag_views: for each of them the tags that it shows.
        camera: the camera of all photographs.
        board: what was printed.
        settings: noise and tolerance.

    Raises:
        MapError: too few views of the board to place it.
    """
    views = _collect(world_T_camera, tag_views, camera, board)
    triangulated = _triangulate(views, camera, settings.max_corner_error)
    seen = [row for row, point in triangulated.items() if point is not None]
    if len(seen) < _MIN_CORNERS:
        raise MapError(
            f"board: only {len(seen)} of its corners can be placed from {len(tag_views)} registered photographs; "
            "take more photographs of it from different sides, near enough that a tag is 30 px or broader"
        )
    world_points = np.array([triangulated[row] for row in seen])
    board_points = np.concatenate(list(board.corners_board.values()))[seen]
    scale, R, t = umeyama(board_points, world_points, with_scale=True)
    scale, R, t, inset_px = _refine(views, camera, scale, R, t, settings)
    residuals = _residuals(views, camera, scale, R, t, inset_px)
    offsets = (world_points - t) @ R / scale - board_points
    residual = _report(views, residuals, np.array(seen), offsets, inset_px)
    map_R_world = R.T if board.map_R_board is None else board.map_R_board @ R.T
    return BoardAlignment(1.0 / scale, map_R_world, -map_R_world @ t / scale, residual)


def _collect(
    world_T_camera: Array, tag_views: Sequence[Sequence[TagView]], camera: CameraModel, board: Board
) -> _Corners:
    rows = [
        (pose, view, board.corners_board[view.tag])
        for pose, views in zip(inverse(world_T_camera), tag_views, strict=True)
        for view in views
        if view.tag in board.corners_board
    ]
    if not rows:
        raise MapError(
            f"board: none of its tags ({board.family}: {', '.join(map(str, board.corners_board))}) is seen in the "
            "registered photographs; photograph it from near by, or leave the board out for a map without scale"
        )
    tags = np.array([view.tag for _, view, _ in rows])
    order = {tag: row for row, tag in enumerate(board.corners_board)}
    pixels = np.concatenate([view.corners for _, view, _ in rows])
    corners_board = np.array([corners for _, _, corners in rows])
    # The centre is the mean, so these are exact for squares and any other parallelogram.
    half_widths = (corners_board * _WIDTH_SIGNS).mean(axis=1)
    half_heights = (corners_board * _HEIGHT_SIGNS).mean(axis=1)
    return _Corners(
        camera_T_world=np.repeat(np.array([pose for pose, _, _ in rows]), 4, axis=0),
        pixels=pixels,
        bearings=camera.unproject(pixels)[0],
        centre_board=np.repeat(corners_board.mean(axis=1), 4, axis=0),
        half_width_board=(_WIDTH_SIGNS * half_widths[:, None]).reshape(-1, 3),
        half_height_board=(_HEIGHT_SIGNS * half_heights[:, None]).reshape(-1, 3),
        breadths=np.repeat(np.array([view.breadths for _, view, _ in rows]), 4, axis=0),
        tags=np.repeat(tags, 4),
        corner_rows=np.array([4 * order[tag] + corner for tag in tags.tolist() for corner in range(4)]),
    )


def _triangulate(views: _Corners, camera: CameraModel, max_error_px: float) -> dict[int, Array | None]:
    """Each corner of the board in the world, from all photographs that agree on it."""
    return {
        row: _triangulate_robustly(views.camera_T_world[at], views.bearings[at], max_error_px / camera.fx)
        for row in np.unique(views.corner_rows).tolist()
        for at in [views.corner_rows == row]
    }


def _triangulate_robustly(camera_T_world: Array, bearings: Array, max_angle: float) -> Array | None:
    """Point (3,) nearest to the rays (N, 3), by leaving out the worst ray until all agree to ``max_angle`` [rad]."""
    R_transposed = np.swapaxes(camera_T_world[:, :3, :3], 1, 2)
    directions = (R_transposed @ bearings[:, :, None])[:, :, 0]
    centres = -(R_transposed @ camera_T_world[:, :3, 3:])[:, :, 0]
    kept = np.arange(len(bearings))
    while len(kept) >= 2:
        # Squared distance to a ray is quadratic in the point: |(I - d d^T)(x - c)|^2, weighted to an angle by depth.
        point = np.zeros(3)
        weights = np.ones(len(kept))
        for _ in range(3):
            across = np.eye(3) - directions[kept, :, None] * directions[kept, None, :]
            normal = np.einsum("n,nij->ij", weights, across)
            if np.linalg.cond(normal) > 1e8:
                return None
            point = np.linalg.solve(normal, np.einsum("n,nij,nj->i", weights, across, centres[kept]))
            weights = 1.0 / np.maximum(np.sum((point - centres[kept]) ** 2, axis=1), 1e-12)
        to_point = point - centres[kept]
        angles = np.linalg.norm(np.cross(directions[kept], to_point), axis=1) / np.linalg.norm(to_point, axis=1)
        worst = int(angles.argmax())
        if angles[worst] <= max_angle:
            return point
        kept = np.delete(kept, worst)
    return None


def _refine(
    views: _Corners, camera: CameraModel, scale: float, R: Array, t: Array, settings: AlignmentSettings
) -> tuple[float, Array, Array, float]:
    """Least squares of the corners' pixels over the board's seven parameters and the inset of the tags' edges.

    The inset is seen in the gaps between tags, which blur widens as much as it shrinks the tags.
    """

    def unpack(x: Array) -> tuple[float, Array, Array, float]:
        return scale * float(np.exp(x[0])), R @ exp_so3(x[1:4]), t + scale * x[4:7], float(x[7])

    growth = np.maximum(1.0, settings.large_breadth / views.breadths.min(axis=1)) ** 2
    noise = settings.corner_noise * growth[:, None]

    def cost(x: Array) -> Array:
        weighted: Array = _residuals(views, camera, *unpack(x)) / noise
        return weighted.ravel()

    solution = least_squares(cost, np.zeros(8), loss="huber", f_scale=2.0, x_scale="jac")
    return unpack(solution.x)


def _residuals(views: _Corners, camera: CameraModel, scale: float, R: Array, t: Array, inset_px: float) -> Array:
    """Pixels (N, 2) from where the board projects, its tags shrunk by the inset, to where the corners were found."""
    shrink = 1.0 - 2.0 * inset_px / views.breadths[:, :, None]
    points_board = views.centre_board + shrink[:, 0] * views.half_width_board + shrink[:, 1] * views.half_height_board
    points_camera = transform_points(views.camera_T_world, (scale * points_board @ R.T + t)[:, None])[:, 0]
    projected, valid = camera.project(points_camera)
    residuals: Array = np.where(valid[:, None], views.pixels - projected, 0.0)
    return residuals


def _report(
    views: _Corners, residuals: Array, corner_rows: NDArray[np.int64], offsets: Array, inset_px: float
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
        inset_px=inset_px,
    )
