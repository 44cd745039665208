"""Corners of squares, where their sides meet.

A saddle of the light is pulled aside where a lens bends the sides that meet there. So sides are fitted, like those of
tags, as lines that are straight in space.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import spline_filter

from bodycam_ros.camera import CameraModel
from bodycam_ros.geometry import Array
from bodycam_ros.lens.board_layout import BoardLayout
from bodycam_ros.mapping.apriltag import breadths_of, corners_of_edges

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
