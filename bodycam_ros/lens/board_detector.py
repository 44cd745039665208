"""Points of a board in a picture: first without a lens, then more and more exactly by the lens that came of it.

A saddle of the light is pulled aside where a lens bends the sides that meet there. So sides are fitted, like those of
tags, as lines that are straight in space.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import spline_filter

from bodycam_ros.camera import CameraModel
from bodycam_ros.geometry import Array, rigid
from bodycam_ros.lens.board_design import read_layout
from bodycam_ros.lens.board_layout import CHECKERBOARD, BoardLayout
from bodycam_ros.mapping.apriltag import (
    breadths_of,
    corners_of_edges,
    find_tags,
    find_tags_in_picture,
    refined_tags,
)

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


_LINE_TOLERANCE_PX = 0.3
_NARROWEST_PX = 7.0  # breadth of a square; below it one side's blur reaches the other's
_AGREE_PX = 1.0  # squares on where the corner between them is


def square_corners(
    gray: NDArray[np.uint8],
    camera: CameraModel,
    layout: BoardLayout,
    numbers: NDArray[np.int64],
    rough: Array,
    is_turned: bool = False,
) -> tuple[NDArray[np.int64], Array, Array]:
    """Numbers of the inner corners that were found (N,), their pixels (N, 2), and breadths of their squares (N,) [px].

    Args:
        gray: picture (H, W).
        camera: its lens.
        layout: of the board.
        numbers, rough: inner corners, and about where they are (M, 2).
        is_turned: what should be black is white.
    """
    spline = spline_filter(gray.astype(np.float32), order=3, output=np.float32)
    at = dict(zip(numbers.tolist(), rough, strict=True))
    found: dict[int, list[tuple[Array, float]]] = {}
    across = layout.columns - 1
    for row, column in np.ndindex(layout.rows - 2, layout.columns - 2):
        first = row * across + column
        around = [first, first + 1, first + across + 1, first + across]  # clockwise
        if layout.black_squares[row + 1, column + 1] == is_turned:
            around.reverse()  # so that a white square has what is dark on the right of its sides, too
        if not all(number in at for number in around):
            continue
        corners = np.array([at[number] for number in around])
        breadths = breadths_of(corners)
        if breadths.min() < _NARROWEST_PX:
            continue
        met = corners_of_edges(spline, corners, breadths, camera, _LINE_TOLERANCE_PX)
        if met is not None:
            for number, corner in zip(around, met, strict=True):
                found.setdefault(number, []).append((corner, float(breadths.min())))
    good = [number for number in sorted(found) if _agree([corner for corner, _ in found[number]])]
    pixels = [np.mean([corner for corner, _ in found[number]], axis=0) for number in good]
    breadth = [max(breadth for _, breadth in found[number]) for number in good]
    return np.array(good, np.int64), np.reshape(pixels, (-1, 2)), np.array(breadth)


def _agree(corners: list[Array]) -> bool:
    return bool(np.ptp(corners, axis=0).max() < _AGREE_PX)


Grey = NDArray[np.uint8]

_LEAST_OF_BOARD = 8
_MIN_BREADTH_PX, _TAG_TOLERANCE_PX = 8.0, 0.3  # what does not fit counts less, so more is looked at
_LEAST_WINDOW, _LARGEST_WINDOW = 2, 9  # [px] half the side of the square that a corner is refined in
_WINDOW_OF_SQUARE = 0.2
_NEAR_SQUARES = 1.3  # from a tag's middle to the corners that it predicts: the four of its square
_CLEAR_PX = 60.0  # breadth of a tag whose corners are as good as they get; those of narrower ones are worse

Found = tuple[Array, Array, Array]
"""Points in the board frame (N, 3), pixels (N, 2), and how uncertain they are (N,)."""


@dataclass(frozen=True)
class LensBoard:
    """The board that a lens is measured by.

    Attributes:
        name: of its file.
        tags: tag -> (4, 3) corners in the board frame [m].
        dictionary: the tags' family in ``cv2.aruco``; None on a checkerboard.
        squares: the layout of a ChArUco board or a checkerboard; None if there are tags alone.
    """

    name: str
    tags: Mapping[int, Array]
    dictionary: int | None
    squares: BoardLayout | None

    @classmethod
    def from_yaml(cls, path: Path) -> "LensBoard":
        """Of a board's file; raises as ``read_layout`` does."""
        layout, tags, dictionary = read_layout(path)
        has_squares = layout is not None and len(layout.inner_corners) > 0
        return cls(str(path), tags, dictionary, layout if has_squares else None)


def find_board(gray: Grey, name: str, board: LensBoard, camera: CameraModel | None) -> BoardSight | None:
    """The points of a board that a picture (H, W) shows, or None if it shows none, or too few.

    Args:
        gray: the picture.
        name: of it.
        board: what to look for.
        camera: its lens, if there is one already; without it tags whose edges the lens bends may be missed, and their
            corners are good to a pixel.
    """
    if board.squares is None:
        found = _tag_corners(gray, board, camera)
    elif board.squares.kind == CHECKERBOARD:
        found = _checkerboard(gray, board.squares, camera)
    else:
        found = _charuco(gray, board, board.squares, camera)
    if found is None or len(found[0]) < _LEAST_OF_BOARD:
        return None
    points, pixels, spreads = found
    return BoardSight(name, points, pixels, spreads, _sharpness(gray, pixels))


def _tag_corners(gray: Grey, board: LensBoard, camera: CameraModel | None) -> Found | None:
    assert board.dictionary is not None
    tags: dict[int, tuple[Array, float]]
    if camera is None:
        tags = {tag: (corners, 1.0) for tag, corners in find_tags_in_picture(gray, board.dictionary)}
    else:
        views = refined_tags(gray, camera, board.dictionary, _MIN_BREADTH_PX, _TAG_TOLERANCE_PX)
        tags = {view.tag: (view.corners, max(1.0, _CLEAR_PX / view.breadths.min())) for view in views}
    known = [tag for tag in tags if tag in board.tags]
    if not known:
        return None
    points = np.concatenate([board.tags[tag] for tag in known])
    return points, np.concatenate([tags[t][0] for t in known]), np.repeat([tags[t][1] for t in known], 4)


def _checkerboard(gray: Grey, layout: BoardLayout, camera: CameraModel | None) -> Found | None:
    size = (layout.columns - 1, layout.rows - 1)
    flags = cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_ACCURACY
    found, corners = cv2.findChessboardCornersSB(gray, size, flags=flags)
    if not found:
        return None
    pixels = np.asarray(corners, np.float64).reshape(-1, 2)
    numbers = np.arange(len(pixels))
    if camera is not None:
        return _by_sides(gray, camera, layout, numbers, pixels, _is_turned(gray, layout, pixels))
    refined, _ = _refined(gray, pixels, _spacing(layout, numbers, pixels))
    return layout.inner_corners, refined, np.ones(len(refined))


def _charuco(gray: Grey, board: LensBoard, layout: BoardLayout, camera: CameraModel | None) -> Found | None:
    """Corners of squares, predicted by the tags beside them."""
    assert board.dictionary is not None
    tags = find_tags_in_picture(gray, board.dictionary) if camera is None else find_tags(gray, camera, board.dictionary)
    predicted: dict[int, list[Array]] = {}
    reach = 0.5 * _NEAR_SQUARES * float(np.hypot(*layout.pitch_m))
    for tag, corners in tags:
        if tag not in board.tags:
            continue
        middle = board.tags[tag].mean(axis=0)
        near = np.flatnonzero(np.linalg.norm(layout.inner_corners - middle, axis=1) < reach)
        pixels = _beside(corners, board.tags[tag], layout.inner_corners[near], camera)
        for number, pixel in zip(near.tolist(), pixels, strict=True):
            if np.isfinite(pixel).all():
                predicted.setdefault(number, []).append(pixel)
    if len(predicted) < _LEAST_OF_BOARD:
        return None
    numbers = np.array(sorted(predicted))
    rough = np.array([np.median(predicted[number], axis=0) for number in numbers.tolist()])
    pixels, good = _refined(gray, rough, _spacing(layout, numbers, rough))
    if camera is not None:
        return _by_sides(gray, camera, layout, numbers[good], pixels[good], False)
    return layout.inner_corners[numbers[good]], pixels[good], np.ones(int(good.sum()))


def _by_sides(
    gray: Grey,
    camera: CameraModel,
    layout: BoardLayout,
    numbers: NDArray[np.int64],
    rough: Array,
    is_turned: bool,
) -> Found:
    found, pixels, breadths = square_corners(gray, camera, layout, numbers, rough, is_turned)
    return layout.inner_corners[found], pixels, np.maximum(1.0, _CLEAR_PX / np.maximum(breadths, 1.0))


def _is_turned(gray: Grey, layout: BoardLayout, pixels: Array) -> bool:
    """Whether a checkerboard was found by half a turn from how it is described: what should be black is white."""
    grid = pixels.reshape(layout.rows - 1, layout.columns - 1, 2)
    middles = 0.25 * (grid[1:, 1:] + grid[:-1, 1:] + grid[1:, :-1] + grid[:-1, :-1])
    columns, rows = middles.round().astype(int).transpose(2, 0, 1)
    light = gray[np.clip(rows, 0, gray.shape[0] - 1), np.clip(columns, 0, gray.shape[1] - 1)]
    black = layout.black_squares[1:-1, 1:-1]
    return float(light[black].mean()) > float(light[~black].mean())


def _beside(corners: Array, tag_board: Array, points_board: Array, camera: CameraModel | None) -> Array:
    """Pixels (N, 2) of points in a tag's plane, by its corners (4, 2): through the lens, or as if it bent nothing."""
    plane = np.ascontiguousarray(tag_board[:, :2])
    wanted = points_board[:, None, :2]
    if camera is None:
        H = cv2.getPerspectiveTransform(plane.astype(np.float32), corners.astype(np.float32))
        return np.asarray(cv2.perspectiveTransform(wanted, H), np.float64)[:, 0]
    rays, valid = camera.unproject(corners)
    if not valid.all():
        return np.full((len(points_board), 2), np.nan)
    # The homography of rays maps the plane to directions, whatever way the tag lies from the camera.
    _, _, vectors = np.linalg.svd(_ray_equations(plane, rays))
    H = vectors[-1].reshape(3, 3)
    directions = np.column_stack([points_board[:, :2], np.ones(len(points_board))]) @ H.T
    middle = np.append(plane.mean(axis=0), 1.0) @ H.T
    return camera.project(directions * np.sign(middle @ rays.mean(axis=0)))[0]


def _ray_equations(plane: Array, rays: Array) -> Array:
    """Rows (12, 9) that the homography's entries make zero: the cross product of H (x, y, 1) and each ray."""
    rows = []
    for (x, y), ray in zip(plane, rays, strict=True):
        point = np.array([x, y, 1.0])
        a, b, c = ray
        rows += [
            np.concatenate([np.zeros(3), -c * point, b * point]),
            np.concatenate([c * point, np.zeros(3), -a * point]),
            np.concatenate([-b * point, a * point, np.zeros(3)]),
        ]
    return np.array(rows)


def _spacing(layout: BoardLayout, numbers: NDArray[np.int64], pixels: Array) -> Array:
    """(N,) distance of each corner of squares to the nearest of its neighbours on the board [px]."""
    columns = layout.columns - 1
    at = np.column_stack([numbers // columns, numbers % columns])
    steps = np.abs(at[:, None] - at[None]).sum(axis=2)
    distances = np.linalg.norm(pixels[:, None] - pixels[None], axis=2)
    nearest: Array = np.where(steps == 1, distances, np.inf).min(axis=1)
    return nearest


def _refined(gray: Grey, rough: Array, spacing: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Corners of squares (N, 2) where the light has its saddles, and which were found."""
    height, width = gray.shape
    finite = np.where(np.isfinite(spacing), spacing, 0.0)
    windows = np.clip(_WINDOW_OF_SQUARE * finite, _LEAST_WINDOW, _LARGEST_WINDOW).astype(int)
    refined = rough.copy()
    room = np.minimum(rough, [width - 1, height - 1] - rough).min(axis=1)
    good = (room > windows + 2) & (finite > 2 * _LEAST_WINDOW)
    end = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_MAX_ITER, 50, 1e-3)
    for row in np.flatnonzero(good).tolist():
        window = int(windows[row])
        corner = rough[row : row + 1, None].astype(np.float32)
        found = cv2.cornerSubPix(gray, corner, (window, window), (-1, -1), end)
        refined[row] = np.asarray(found, np.float64).ravel()
        good[row] = np.linalg.norm(refined[row] - rough[row]) < window
    return refined, good


def _sharpness(gray: Grey, pixels: Array) -> float:
    """The steepest change from one pixel to the next around the board, as a share of its contrast."""
    low = np.maximum(np.floor(pixels.min(axis=0)).astype(int), 0)
    high = np.ceil(pixels.max(axis=0)).astype(int) + 1
    part = gray[low[1] : high[1], low[0] : high[0]].astype(np.float32)
    if min(part.shape) < 3:
        return 0.0
    dark, bright = np.percentile(part, [5.0, 95.0])
    steps = np.hypot(part[1:-1, 2:] - part[1:-1, :-2], part[2:, 1:-1] - part[:-2, 1:-1])
    return float(0.5 * np.percentile(steps, 99.0) / max(1.0, bright - dark))
