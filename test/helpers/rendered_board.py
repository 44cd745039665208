"""Pictures of a printed board through any lens, for tests: what a hand that holds it in front of a camera makes."""

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from bodycam_ros.boards.board_layout import APRILTAG, BoardLayout, tag_cells
from bodycam_ros.camera import CameraModel
from bodycam_ros.geometry import exp_so3, inverse, rigid

Array = NDArray[np.float64]

_FINE = 2  # samples of a pixel along each side
_TEXELS = 600  # along the longer side of the paper: about as many as samples, so that nothing is between two of them
_MARGIN = 0.06  # of paper around what is printed, of the longer side
_DARK = 22.0
_PAPER = 225.0
_WALL = 110.0


class RenderedBoard:
    """A board on white paper before a grey wall; its rays are found once.

    Args:
        camera: that takes the pictures.
        layout: what is on the board.
        noise: standard deviation of the pixels' noise [grey levels].
    """

    def __init__(self, camera: CameraModel, layout: BoardLayout, noise: float = 1.5) -> None:
        self._camera = camera
        self._noise = noise
        height, width = camera.height * _FINE, camera.width * _FINE
        columns, rows = np.meshgrid(np.arange(width), np.arange(height))
        pixels = (np.stack([columns.ravel(), rows.ravel()], axis=1) + 0.5) / _FINE - 0.5
        rays, valid = camera.unproject(pixels)
        self._rays = np.where(valid[:, None], rays, 0.0).astype(np.float32)
        self._is_lit = valid.reshape(height, width)
        margin = _MARGIN * max(board_size(layout))
        self._half = 0.5 * np.array(board_size(layout)) + margin
        self._texels_per_m = _TEXELS / (2.0 * float(self._half.max()))
        self._texture = _texture(layout, self._half, self._texels_per_m)

    def picture(self, camera_T_board: Array, blur_px: float = 0.6, seed: int = 0) -> NDArray[np.uint8]:
        """Grey pixels (H, W)."""
        board_T_camera = inverse(camera_T_board)
        origin = board_T_camera[:3, 3]
        directions = self._rays @ board_T_camera[:3, :3].T.astype(np.float32)
        with np.errstate(all="ignore"):
            ahead = np.float32(-origin[2]) / directions[:, 2]
            at = origin[:2].astype(np.float32) + directions[:, :2] * ahead[:, None]
        at[~(ahead > 0.0)] = 1e3
        at = np.clip(at, -1e3, 1e3)
        texels = ((at * [1.0, -1.0] + self._half) * self._texels_per_m - 0.5).astype(np.float32)
        maps = texels.reshape(*self._is_lit.shape, 2)
        light = cv2.remap(
            self._texture, maps, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=_WALL
        )
        light[~self._is_lit] = 0.0
        light = cv2.GaussianBlur(light, (0, 0), blur_px * _FINE)
        light = cv2.resize(light, (self._camera.width, self._camera.height), interpolation=cv2.INTER_AREA)
        noisy = light + np.random.default_rng(seed).normal(0.0, self._noise, light.shape)
        return np.round(np.clip(noisy, 0.0, 255.0)).astype(np.uint8)


def held_poses(camera: CameraModel, layout: BoardLayout, count: int, seed: int = 3, size: float = 0.45) -> list[Array]:
    """camera_T_board (4, 4) of a board that is brought to every part of the picture, and tilted.

    Args:
        size: share of the picture's shorter side that its longer side about fills.
    """
    random = np.random.default_rng(seed)
    poses = []
    golden = np.pi * (3.0 - np.sqrt(5.0))
    half = 0.5 * np.array([camera.width - 1, camera.height - 1])
    for k in range(count):
        radius, turn = np.sqrt((k + 0.5) / count), golden * k
        pixel = half + 0.93 * half * radius * np.array([np.cos(turn), np.sin(turn)]) * 1.15
        pixel = np.clip(pixel, 0.05 * half, 1.95 * half)
        ray, valid = camera.unproject(pixel[None])
        if not valid[0]:
            continue
        towards = ray[0]
        across = np.cross([0.0, 1.0, 0.0], towards)
        across /= np.linalg.norm(across)
        # Facing the camera, upright: board x to the right, y up, z back at it.
        facing = np.stack([across, -np.cross(towards, across), -towards], axis=1)
        tilt = random.uniform(0.1, 0.7)
        way = random.uniform(0.0, 2.0 * np.pi)
        tilted = exp_so3(tilt * np.array([np.cos(way), np.sin(way), 0.0])) @ exp_so3(
            np.array([0.0, 0.0, random.uniform(-0.6, 0.6)])
        )
        distance = max(board_size(layout)) * camera.fx / (size * min(camera.width, camera.height))
        poses.append(rigid(facing @ tilted, towards * distance * random.uniform(0.8, 1.3)))
    return poses


def rendered(
    camera: CameraModel, layout: BoardLayout, poses: Sequence[Array], blur_px: float = 0.6
) -> list[NDArray[np.uint8]]:
    """Pictures of the board, one a pose."""
    board = RenderedBoard(camera, layout)
    return [board.picture(pose, blur_px, seed) for seed, pose in enumerate(poses)]


def board_size(layout: BoardLayout) -> tuple[float, float]:
    """Width and height of what is printed [m]."""
    width, height = layout.columns * layout.pitch_m[0], layout.rows * layout.pitch_m[1]
    if layout.kind == APRILTAG:
        return width - layout.pitch_m[0] + layout.tag_m[0], height - layout.pitch_m[1] + layout.tag_m[1]
    return width, height


def _texture(layout: BoardLayout, half: Array, texels_per_m: float) -> NDArray[np.float32]:
    """Light of the paper from its upper left corner: by the board's measures, not by the outlines that are printed."""
    width, height = np.round(2.0 * half * texels_per_m).astype(int)
    black = np.zeros((height, width))

    def paint(left: float, top: float, size: Sequence[float], cells: NDArray[np.bool_]) -> None:
        """Add the share of each texel that black cells (rows, columns) cover; their upper left corner is given [m]."""
        across = _overlaps((left + half[0]) * texels_per_m, size[0] * texels_per_m, cells.shape[1], width)
        down = _overlaps((half[1] - top) * texels_per_m, size[1] * texels_per_m, cells.shape[0], height)
        np.add(black, down @ cells @ across.T, out=black)

    if len(layout.inner_corners):
        width_m, height_m = board_size(layout)
        paint(-0.5 * width_m, 0.5 * height_m, (width_m, height_m), layout.black_squares)
    for tag, corners in layout.tags.items():
        white = tag_cells(cv2.aruco.getPredefinedDictionary(layout.dictionary), tag)
        paint(corners[0, 0], corners[0, 1], layout.tag_m, ~white)
    return (_PAPER + (_DARK - _PAPER) * black).astype(np.float32)


def _overlaps(start: float, size: float, cells: int, texels: int) -> Array:
    """(texels, cells) length that a texel and a cell have in common along one axis [texels]."""
    edges = start + size * np.arange(cells + 1) / cells
    at = np.arange(texels)[:, None]
    return np.clip(np.minimum(at + 1, edges[1:]) - np.maximum(at, edges[:-1]), 0.0, None)
