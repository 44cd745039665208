"""How far blur moves the sides of a tag, and where they are without it.

The brightness across a side is steepest where the side is, unless blur mixes it with the next sides: those of the white
cells behind the tag's border, which move it outwards, and those of what is dark beyond the paper around the tag, which
move it inwards. Both are known, so that the width of the blur, which the slope's curvature shows, gives the shift.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_CORNERS = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])  # of a tag, clockwise; y downwards
_ROUNDS, _STEPS = 5, 4  # of the width of the blur; of Newton's method for the steepest place
_LARGEST_SHIFT = 1.0  # [px]
_LEAST_PX2, _MOST_PX2 = 0.3, 9.0  # square of the blur's width
_TINY = 1e-6


@dataclass(frozen=True)
class BlurredSide:
    """Where the brightness across one side of a tag is steepest.

    Attributes:
        stations: (N,) share of the side, from its start.
        points: (N, 2) pixels.
        outward: (N, 2) unit vectors across the side, away from the tag.
        widths_px2: (N,) square of the width of the slope, by its height and curvature there [px^2].
    """

    stations: Array
    points: Array
    outward: Array
    widths_px2: Array


def without_blur(sides: Sequence[BlurredSide], corners: Array, cells: NDArray[np.bool_], paper: Array) -> list[Array]:
    """Points (N, 2) of the four sides of a tag without the shift by blur.

    Args:
        sides: from the upper left corner clockwise, none of them empty.
        corners: (4, 2) about where the tag's corners are [px].
        cells: (n, n) which of its cells are white, the border included.
        paper: (4,) breadth of the white paper beside each side, of the tag's breadth; 1 where nothing dark is near.
    """
    from scipy.special import ndtr

    inside = cells[1], cells[:, -2], cells[-2, ::-1], cells[::-1, 1]
    next_sides = [_next_sides(side, k, corners, len(cells), paper[k]) for k, side in enumerate(sides)]
    cells_px = np.linalg.norm(np.roll(corners, -1, axis=0) - corners, axis=1) / len(cells)
    width_px2 = float(np.median(np.concatenate([side.widths_px2 for side in sides])))
    # The measured width is that of the sum of the slopes; that of each follows by repetition.
    for _ in range(_ROUNDS):
        shifts, widths = [], []
        for side, at, white, cell_px in zip(sides, next_sides, inside, cells_px, strict=True):
            from_cells = side.stations[:, None] * len(cells) - np.arange(len(cells) + 1)
            share = -np.diff(ndtr(from_cells * cell_px / np.sqrt(width_px2)), axis=1) @ white
            shift, seen_px2 = _steepest(width_px2, at, np.stack([-share, -np.ones(len(share))]))
            shifts.append(shift)
            widths.append(side.widths_px2 * width_px2 / seen_px2)
        width_px2 = float(np.clip(np.median(np.concatenate(widths)), _LEAST_PX2, _MOST_PX2))
    return [side.points - shift[:, None] * side.outward for side, shift in zip(sides, shifts, strict=True)]


def _next_sides(side: BlurredSide, number: int, corners: Array, cells: int, paper: float) -> Array:
    """How far outwards (2, N) the cells inside the border start, and what is dark beyond the paper [px]."""
    start, end = _CORNERS[number], _CORNERS[(number + 1) % 4]
    inward = np.array([start[1] - end[1], end[0] - start[0]])
    depths = np.array([0.0, 1.0 / cells, -paper])
    on_tag = start + side.stations[:, None] * (end - start) + depths[:, None, None] * inward
    H = cv2.getPerspectiveTransform(_CORNERS.astype(np.float32), corners.astype(np.float32))
    pixels = np.asarray(cv2.perspectiveTransform(on_tag.reshape(-1, 1, 2), H), np.float64).reshape(3, -1, 2)
    offsets: Array = np.sum((pixels[1:] - pixels[0]) * side.outward, axis=2)
    return offsets


def _steepest(width_px2: float, next_sides: Array, heights: Array) -> tuple[Array, Array]:
    """Where (N,) brightness is steepest, and the square of the slope's width there, if other sides (M, N) are near.

    Args:
        width_px2: of the slope of each side alone.
        next_sides: how far outwards the others are [px].
        heights: (M, N) of their slopes, against that of the side itself.
    """
    at = np.vstack([np.zeros_like(next_sides[:1]), next_sides])
    height = np.vstack([np.ones_like(heights[:1]), heights])
    steepest = np.zeros(at.shape[1])
    for _ in range(_STEPS):
        away = steepest - at
        slopes = height * np.exp(-0.5 * away**2 / width_px2)
        curvature = np.minimum(np.sum((away**2 / width_px2 - 1.0) * slopes, axis=0) / width_px2, -_TINY)
        step = np.sum(away * slopes, axis=0) / width_px2 / curvature
        steepest = np.clip(steepest + step, -_LARGEST_SHIFT, _LARGEST_SHIFT)
    return steepest, -slopes.sum(axis=0) / curvature
