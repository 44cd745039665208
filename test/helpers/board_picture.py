"""Photographs of an AprilTag board as a camera of known pose takes them, for tests."""

import cv2
import numpy as np
from numpy.typing import NDArray

from bodycam_ros.boards.board import Board
from bodycam_ros.camera import CameraModel, camera_from_info
from bodycam_ros.geometry import inverse, rigid

TAG = 0.2  # [m]
GAP = 0.05
_TEXELS = 40  # per cell of a tag: 8 cells across
_SUPERSAMPLING = 3


def two_by_two_board() -> Board:
    """Four tags around the origin of a lying board."""
    step = (TAG + GAP) / 2
    half = np.array([[-TAG, TAG, 0.0], [TAG, TAG, 0.0], [TAG, -TAG, 0.0], [-TAG, -TAG, 0.0]]) / 2
    centres = [(-step, step), (step, step), (-step, -step), (step, -step)]
    return Board("36h11", {tag: half + [x, y, 0.0] for tag, (x, y) in enumerate(centres)}, np.eye(3))


def wide_camera() -> CameraModel:
    """A camera whose lens bends lines visibly."""
    return camera_from_info(
        "wide", 400, 300, "plumb_bob", [-0.15, 0.03, 0.0005, -0.0004, 0.0], [320, 0, 201.3, 0, 321, 148.2, 0, 0, 1]
    )


def looking_at_origin(x: float, y: float, z: float, roll: float = 0.3) -> NDArray[np.float64]:
    """board_T_camera (4, 4) of a camera at (x, y, z) that looks at the origin."""
    centre = np.array([x, y, z], dtype=np.float64)
    forward = -centre / np.linalg.norm(centre)
    right = np.cross(forward, [0.0, 0.0, 1.0] if abs(forward[2]) < 0.9 else [0.0, 1.0, 0.0])
    right /= np.linalg.norm(right)
    down = np.cross(forward, right)
    R = np.stack([right, down, forward], axis=1)
    roll_R = np.array([[np.cos(roll), -np.sin(roll), 0.0], [np.sin(roll), np.cos(roll), 0.0], [0.0, 0.0, 1.0]])
    return rigid(R @ roll_R, centre)


def board_picture(
    camera: CameraModel, board_T_camera: NDArray[np.float64], board: Board, blur_px: float = 0.8, gamma: float = 1.0
) -> NDArray[np.uint8]:
    """Picture (rows, columns, 3) of the board on a bright floor; light is blurred, then recorded with gamma."""
    texture, texels_per_m, origin = _texture(board)
    n = _SUPERSAMPLING
    columns, rows = np.meshgrid(np.arange(camera.width * n), np.arange(camera.height * n))
    pixels = (np.stack([columns.ravel(), rows.ravel()], axis=1) + 0.5) / n - 0.5
    bearings, _ = camera.unproject(pixels)
    R, t = board_T_camera[:3, :3], board_T_camera[:3, 3]
    directions = bearings @ R.T
    with np.errstate(all="ignore"):
        ahead = -t[2] / directions[:, 2:]
    on_board = np.where(ahead > 0.0, t + directions * ahead, 1e3)  # far away, where the floor is
    at = (on_board[:, :2] * [1.0, -1.0] + origin) * texels_per_m - 0.5
    at = at.astype(np.float32).reshape(camera.height * n, camera.width * n, 2)
    light = cv2.remap(
        texture, at[..., 0], at[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=0.9
    )
    light = cv2.GaussianBlur(light, (0, 0), blur_px * n)
    light = cv2.resize(light, (camera.width, camera.height), interpolation=cv2.INTER_AREA)
    gray = np.round(255.0 * np.clip(light, 0.0, 1.0) ** (1.0 / gamma)).astype(np.uint8)
    return np.asarray(cv2.cvtColor(gray, cv2.COLOR_GRAY2BGR), dtype=np.uint8)


def true_corners(
    camera: CameraModel, board_T_camera: NDArray[np.float64], board: Board
) -> dict[int, NDArray[np.float64]]:
    """Tag -> (4, 2) pixels where its corners are."""
    camera_T_board = inverse(board_T_camera)
    return {
        tag: camera.project(corners @ camera_T_board[:3, :3].T + camera_T_board[:3, 3])[0]
        for tag, corners in board.corners_board.items()
    }


def _texture(board: Board) -> tuple[NDArray[np.float32], float, NDArray[np.float64]]:
    """Light of the board's face, texels per metre, and the board's origin from the upper left, y downwards [m]."""
    texels_per_m = 8 * _TEXELS / TAG
    reach = 2 * (TAG + GAP)
    size = int(round(2 * reach * texels_per_m))
    texture = np.full((size, size), 0.9, dtype=np.float32)
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    for tag, corners in board.corners_board.items():
        draw = getattr(cv2.aruco, "generateImageMarker", None) or cv2.aruco.drawMarker  # the latter in OpenCV 4.6
        marker = draw(dictionary, tag, 8 * _TEXELS)
        column, row = np.round((corners[0, :2] * [1.0, -1.0] + reach) * texels_per_m).astype(int)
        texture[row : row + 8 * _TEXELS, column : column + 8 * _TEXELS] = 0.05 + 0.85 * (marker > 127)
    return texture, texels_per_m, np.array([reach, reach])
