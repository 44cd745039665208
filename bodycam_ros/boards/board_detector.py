"""Points of a board in a picture: first without a lens, then more of them by the lens that came of it."""

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from bodycam_ros.boards.apriltag import detect_tags, find_tags
from bodycam_ros.boards.board_layout import APRILTAG, CHARUCO, CHECKERBOARD, BoardLayout
from bodycam_ros.camera import CameraModel
from bodycam_ros.geometry import Array, rigid, rotation_to_z

Grey = NDArray[np.uint8]

Found = tuple[Array, Array, Array]
"""Points in the board frame (N, 3), pixels (N, 2), and how uncertain they are (N,)."""

_FLAT_M = 1e-9
_NARROW = 0.2  # cosine of the angle to the middle of the points, beyond which a perspective image of them is too wide
_LEAST_POINTS = 6
_LEAST_OF_BOARD = 8
_MIN_BREADTH_PX, _TAG_TOLERANCE_PX = 8.0, 0.3  # of a tag; what does not fit counts less, so more is used
_CLEAR_PX = 60.0  # breadth of a tag whose corners are as good as they get; those of narrower ones are worse
_LEAST_WINDOW, _LARGEST_WINDOW = 2, 12  # [px] half the side of the square that a corner is refined in
_WINDOW_OF_SQUARE, _WINDOW_BESIDE_TAG = 0.4, 0.12  # of a square's side; a tag starts at an eighth of it
_NEAR_SQUARES = 1.3  # from a tag's middle to the corners that it predicts: the four of its square
_SEARCH_PX = 1200  # width that the sector finder is given: it takes seconds on larger pictures
_FLAT_SHARE = 0.03  # of the picture's width by which points of a plane may differ from a perspective image of it


@dataclass(frozen=True)
class BoardView:
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

    @property
    def flat_points(self) -> int:
        """Points that a perspective image of the board explains, as far as lenses bend."""
        if len(self.pixels) < _LEAST_POINTS:
            return 0
        tolerance = _FLAT_SHARE * float(np.ptp(self.pixels, axis=0).max())
        _, inliers = cv2.findHomography(self.points_board[:, :2], self.pixels, cv2.RANSAC, tolerance)
        return 0 if inliers is None else int(inliers.sum())


@dataclass(frozen=True)
class LensBoard:
    """The board that a lens is measured by.

    Attributes:
        name: of its file.
        layout: what is on it.
        is_inverted: what should be black is white.
        is_mirrored: board or pictures are mirrored.
        remark: how it differs from its file, for people.
    """

    name: str
    layout: BoardLayout
    is_inverted: bool = False
    is_mirrored: bool = False
    remark: str = ""

    def variants(self) -> list["LensBoard"]:
        """The board as described, then as it may have been printed, photographed or counted instead."""
        inverted = replace(self, is_inverted=True, remark="the board is inverted: white where its file has black")
        layout = self.layout
        if layout.kind == CHECKERBOARD:
            more = replace(layout, columns=layout.columns + 1, rows=layout.rows + 1)
            counted = f"it has {more.columns} x {more.rows} squares; its file seems to count inner corners"
            return [self, inverted, replace(self, layout=more, remark=counted)]
        mirrored = "the board, or each picture, is mirrored; this lens is for pictures like these"
        boards = [self, inverted, replace(self, is_mirrored=True, remark=mirrored)]
        if layout.kind == CHARUCO:
            other = replace(layout, upper_left_is_black=not layout.upper_left_is_black)
            colour = "black" if other.upper_left_is_black else "white"
            boards.append(replace(self, layout=other, remark=f"its upper left square is {colour}, unlike its file"))
        return boards


def find_board(gray: Grey, name: str, board: LensBoard, camera: CameraModel | None) -> BoardView | None:
    """The points of a board that a picture (H, W) shows, or None if it shows none, or too few.

    Args:
        gray: the picture.
        name: of it.
        board: what to find.
        camera: its lens, if there is one already; without it tags whose edges the lens bends may be missed, and their
            corners are good to a pixel.
    """
    picture = 255 - gray if board.is_inverted else gray
    if board.is_mirrored:
        picture = np.ascontiguousarray(picture[:, ::-1])
        camera = None if camera is None else _mirrored(camera)
    if board.layout.kind == APRILTAG:
        found = _tag_corners(picture, board.layout, camera)
    elif board.layout.kind == CHECKERBOARD:
        found = _checkerboard(picture, board.layout)
    else:
        found = _charuco(picture, board.layout, camera)
    if found is None or len(found[0]) < _LEAST_OF_BOARD:
        return None
    points, pixels, spreads = found
    if board.is_mirrored:
        points = points * [-1.0, 1.0, 1.0]
        pixels = np.column_stack([gray.shape[1] - 1 - pixels[:, 0], pixels[:, 1]])
    return BoardView(name, points, pixels, spreads, _sharpness(gray, pixels))


def board_pose(camera: CameraModel, view: BoardView) -> tuple[Array, float] | None:
    """camera_T_board (4, 4) and its median error [px] by a lens, or None where that sees too few points."""
    rays, valid = camera.unproject(view.pixels)
    if valid.sum() < _LEAST_POINTS:
        return None
    middle = rays[valid].mean(axis=0)
    view_R_camera = rotation_to_z(middle / np.linalg.norm(middle))
    rays_view = rays @ view_R_camera.T
    with np.errstate(invalid="ignore"):
        used = valid & (rays_view[:, 2] > _NARROW)
    if used.sum() < _LEAST_POINTS:
        return None
    image = rays_view[used, :2] / rays_view[used, 2:]
    points = view.points_board[used]
    best = None
    for view_T_board in _perspective_poses(points, image):
        camera_T_board = rigid(view_R_camera.T, np.zeros(3)) @ view_T_board
        seen, in_view = camera.project(view.points_board @ camera_T_board[:3, :3].T + camera_T_board[:3, 3])
        error = np.where(in_view, np.linalg.norm(seen - view.pixels, axis=1), np.inf)
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


def _mirrored(camera: CameraModel) -> CameraModel:
    """The camera of pictures that are mirrored left to right, but for tangential distortion."""
    return replace(camera, cx=camera.width - 1 - camera.cx)


def _tag_corners(gray: Grey, board: BoardLayout, camera: CameraModel | None) -> Found | None:
    assert board.dictionary is not None
    tags: dict[int, tuple[Array, float]]
    if camera is None:
        tags = {tag: (corners, 1.0) for tag, corners in find_tags(gray, None, board.dictionary)}
    else:
        views = detect_tags(gray, camera, board.dictionary, _MIN_BREADTH_PX, _TAG_TOLERANCE_PX)
        tags = {view.tag: (view.corners, max(1.0, _CLEAR_PX / view.breadths.min())) for view in views}
    known = [tag for tag in tags if tag in board.tags]
    if not known:
        return None
    points = np.concatenate([board.tags[tag] for tag in known])
    return points, np.concatenate([tags[t][0] for t in known]), np.repeat([tags[t][1] for t in known], 4)


def _checkerboard(gray: Grey, layout: BoardLayout) -> Found | None:
    """All inner corners, by OpenCV's finder of sectors, which survives blur and is quick where there is no board."""
    size = (layout.columns - 1, layout.rows - 1)
    scale = min(1.0, _SEARCH_PX / gray.shape[1])
    small = cv2.resize(gray, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    found, corners = cv2.findChessboardCornersSB(small, size, flags=cv2.CALIB_CB_NORMALIZE_IMAGE)
    if not found:
        return None
    rough = (np.asarray(corners, np.float64).reshape(-1, 2) + 0.5) / scale - 0.5
    pixels, good = _refined(gray, rough, _spacing(layout, np.arange(len(rough)), rough), _WINDOW_OF_SQUARE)
    return layout.inner_corners[good], pixels[good], np.ones(int(good.sum()))


def _charuco(gray: Grey, layout: BoardLayout, camera: CameraModel | None) -> Found | None:
    """Corners of squares, predicted by the tags beside them."""
    assert layout.dictionary is not None
    tags = find_tags(gray, camera, layout.dictionary)
    predicted: dict[int, list[Array]] = {}
    reach = 0.5 * _NEAR_SQUARES * float(np.hypot(*layout.pitch_m))
    for tag, corners in tags:
        if tag not in layout.tags:
            continue
        middle = layout.tags[tag].mean(axis=0)
        near = np.flatnonzero(np.linalg.norm(layout.inner_corners - middle, axis=1) < reach)
        pixels = _beside(corners, layout.tags[tag], layout.inner_corners[near], camera)
        for number, pixel in zip(near.tolist(), pixels, strict=True):
            if np.isfinite(pixel).all():
                predicted.setdefault(number, []).append(pixel)
    if len(predicted) < _LEAST_OF_BOARD:
        return None
    numbers = np.array(sorted(predicted))
    rough = np.array([np.median(predicted[number], axis=0) for number in numbers.tolist()])
    pixels, good = _refined(gray, rough, _spacing(layout, numbers, rough), _WINDOW_BESIDE_TAG)
    return layout.inner_corners[numbers[good]], pixels[good], np.ones(int(good.sum()))


def _beside(corners: Array, tag_board: Array, points_board: Array, camera: CameraModel | None) -> Array:
    """Pixels (N, 2) of points in a tag's plane, by its corners (4, 2): through the lens, or as if it bent nothing."""
    plane = np.ascontiguousarray(tag_board[:, :2], np.float32)
    wanted = points_board[:, None, :2]
    rays, view_R_camera = corners, np.eye(3)
    if camera is not None:
        bearings, valid = camera.unproject(corners)
        middle = bearings.mean(axis=0)
        view_R_camera = rotation_to_z(middle / np.linalg.norm(middle)) if valid.all() else view_R_camera
        in_view = bearings @ view_R_camera.T
        if not valid.all() or in_view[:, 2].min() <= _NARROW:
            return np.full((len(points_board), 2), np.nan)
        rays = in_view[:, :2] / in_view[:, 2:]
    H = cv2.getPerspectiveTransform(plane, rays.astype(np.float32))
    moved = np.asarray(cv2.perspectiveTransform(wanted, H), np.float64)[:, 0]
    if camera is None:
        return moved
    pixels, valid = camera.project(np.column_stack([moved, np.ones(len(moved))]) @ view_R_camera)
    return np.where(valid[:, None], pixels, np.nan)


def _spacing(layout: BoardLayout, numbers: NDArray[np.int64], pixels: Array) -> Array:
    """(N,) distance of each corner of squares to the nearest of its neighbours on the board [px]."""
    columns = layout.columns - 1
    at = np.column_stack([numbers // columns, numbers % columns])
    steps = np.abs(at[:, None] - at[None]).sum(axis=2)
    distances = np.linalg.norm(pixels[:, None] - pixels[None], axis=2)
    nearest: Array = np.where(steps == 1, distances, np.inf).min(axis=1)
    return nearest


def _refined(gray: Grey, rough: Array, spacing: Array, window_share: float) -> tuple[Array, NDArray[np.bool_]]:
    """Corners of squares (N, 2) where the light has its saddles, and which were found."""
    height, width = gray.shape
    finite = np.where(np.isfinite(spacing), spacing, 0.0)
    windows = np.clip(window_share * finite, _LEAST_WINDOW, _LARGEST_WINDOW).astype(int)
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
