"""Which pictures of a board are taken: sharp ones, spread over the image and over the ways the board was turned."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.geometry import Array
from bodycam_ros.lens.board_detector import BoardSight

CELLS = (6, 8)
"""Rows and columns that a picture is divided into."""

_BETTER = 75.0  # percentile of the sharpness that pictures are measured against
_TURNED = 4  # directions that the board's face may be turned to, beside straight at the camera
_TILTED = np.sin(np.radians(15.0))


def cells_of(pixels: Array, width: int, height: int) -> NDArray[np.int64]:
    """(N,) number of the cell that each pixel (N, 2) is in."""
    rows, columns = CELLS
    across = np.clip((pixels[:, 0] + 0.5) / width * columns, 0, columns - 1).astype(np.int64)
    down = np.clip((pixels[:, 1] + 0.5) / height * rows, 0, rows - 1).astype(np.int64)
    return down * columns + across


def choose_sights(
    sights: Sequence[BoardSight], poses: Array, width: int, height: int, most: int, min_sharpness: float
) -> list[int]:
    """Rows of the pictures to take, the one that adds most first.

    Args:
        sights: the pictures.
        poses: (V, 4, 4) camera_T_board of each, roughly.
        width, height: of a picture [px].
        most: pictures to take.
        min_sharpness: share of the better pictures' sharpness.
    """
    sharpness = np.array([sight.sharpness for sight in sights])
    usual = float(np.percentile(sharpness, _BETTER))
    left = [row for row in range(len(sights)) if sharpness[row] >= min_sharpness * usual]
    kinds = _turned(poses)
    cells = [np.unique(cells_of(sight.pixels, width, height)) for sight in sights]
    seen = np.zeros((1 + _TURNED, CELLS[0] * CELLS[1]))
    chosen: list[int] = []
    while left and len(chosen) < most:
        gains = [
            float((1.0 / (1.0 + seen[kinds[row], cells[row]])).sum()) * min(1.0, sharpness[row] / usual) for row in left
        ]
        row = left.pop(int(np.argmax(gains)))
        seen[kinds[row], cells[row]] += 1.0
        chosen.append(row)
    return chosen


def _turned(poses: Array) -> NDArray[np.int64]:
    """(V,) 0 where the board faces the camera, else which way it is turned."""
    towards = poses[:, :3, 3] / np.linalg.norm(poses[:, :3, 3], axis=1, keepdims=True)
    faces = poses[:, :3, 2]
    across = faces - np.sum(faces * towards, axis=1, keepdims=True) * towards
    way = np.floor((np.arctan2(across[:, 1], across[:, 0]) + np.pi) / (2.0 * np.pi) * _TURNED).astype(np.int64)
    return np.where(np.linalg.norm(across, axis=1) < _TILTED, 0, 1 + np.clip(way, 0, _TURNED - 1))
