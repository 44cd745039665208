"""Paints into a station's image what its lines are about: surface, visible contour, and forces on it (B figures 2, 7).

A force is how far a line would move the contour: outward cyan, inward red, several times enlarged.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from bodycam_ros.body.surface import NOBODY
from bodycam_ros.geometry import Array
from bodycam_ros.results.colours import FAINT, rgb
from bodycam_ros.static_cameras.static_camera import SHRINK, Contour

Image = NDArray[np.uint8]

CONTOUR, SILENT = "#ffe14d", "#8f8f86"
"""A point of the contour, and one whose line does not know where to move it."""

OUTWARD, INWARD = "#12d9ff", "#ff2a1f"

ENLARGED = 4.0
"""How many times longer than the way that a line would move the contour its force is drawn."""

_TINT = 0.28  # share of the surface's colour in the image
_SUBPIXEL = 4  # bits
_THICK_PX, _RADIUS_PX = 2, 2.2  # of lines and points in the picture, however much it is magnified
_SMALLEST = 0.5  # share of these in a picture that is made smaller: points are close to each other there
_ROOM = 1.15  # of a window around the body
_MIN_WINDOW_PX = 80
_LEAST_FORCE_PX = 0.15  # below it, a force is not there to be seen


@dataclass(frozen=True)
class Window:
    """A part of an image, and how many times it is magnified.

    Attributes:
        left, top, width, height: of the part [px of the image].
        times: pixels of the picture, across, that are one of the image; less than 1 where it is made smaller.
    """

    left: int
    top: int
    width: int
    height: int
    times: float = 1.0

    def place(self, pixels: Array) -> Array:
        """Where pixels (..., 2) of the image are in the picture."""
        placed: Array = (pixels - [self.left, self.top] + 0.5) * self.times - 0.5
        return placed


def square_window(image: Image, covered: Array | None) -> Window:
    """A square of an image around the pixels (2, 2) that show the body, not magnified; None: around the whole image."""
    size = np.array(image.shape[1::-1])
    if covered is None:
        side, middle = int(size.max()), size / 2.0
    else:
        middle, extent = covered.mean(axis=0), float(np.ptp(covered, axis=0).max())
        side = max(_MIN_WINDOW_PX, round(_ROOM * extent))
    # Within the image where it is no larger than that.
    start = np.round(middle - side / 2.0).astype(int)
    left, top = np.where(side <= size, np.clip(start, 0, np.maximum(size - side, 0)), (size - side) // 2).tolist()
    return Window(left, top, side, side)


def paint_contour(part: Image, contour: Contour, shifts: Array, colours: Sequence[str], window: Window) -> Image:
    """A part of a station's image with the body painted into it: (height, width, 3) times magnified.

    Args:
        part: of the image, as ``cut_out`` has it.
        contour: of the body in the image.
        shifts: (N,) how far outward of its points the image has it [px]; NaN where no line measures it.
        colours: of the segments' surfaces, as ``#rrggbb``.
        window: that the part was cut out by.
    """
    table = np.array([bgr(colour) for colour in colours], np.float64)
    labels = contour.labels.repeat(SHRINK, axis=0).repeat(SHRINK, axis=1)
    labels = _cut(labels, window, NOBODY, cv2.INTER_NEAREST_EXACT)
    picture, shown = part.copy(), labels != NOBODY
    picture[shown] = ((1.0 - _TINT) * picture[shown] + _TINT * table[labels[shown]]).astype(np.uint8)
    places = window.place(contour.pixels)
    ends = places + window.times * ENLARGED * np.nan_to_num(shifts)[:, None] * contour.normals
    for place, end, shift in zip(places, ends, shifts.tolist(), strict=True):
        if abs(shift) > _LEAST_FORCE_PX:
            colour = bgr(OUTWARD if shift > 0.0 else INWARD)
            cv2.line(picture, _fixed(place), _fixed(end), colour, _THICK_PX, cv2.LINE_AA, _SUBPIXEL)
    radius = round(2**_SUBPIXEL * _RADIUS_PX * float(np.clip(window.times, _SMALLEST, 1.0)))
    for place, shift in zip(places, shifts.tolist(), strict=True):
        colour = bgr(SILENT if np.isnan(shift) else CONTOUR)
        cv2.circle(picture, _fixed(place), radius, colour, cv2.FILLED, cv2.LINE_AA, _SUBPIXEL)
    return picture


def bgr(colour: str) -> tuple[int, int, int]:
    """Blue, green and red, 0 to 255, of ``#rrggbb``."""
    red, green, blue = rgb(colour)
    return blue, green, red


def cut_out(image: Image, window: Window) -> Image:
    """The part of an image (H, W, 3) in a window, magnified; what lies beyond its borders is grey."""
    return _cut(image, window, bgr(FAINT), cv2.INTER_LINEAR if window.times >= 1.0 else cv2.INTER_AREA)


def _cut(image: Image, window: Window, beyond: ArrayLike, interpolation: int) -> Image:
    top, left = max(window.top, 0), max(window.left, 0)
    inside = image[top : max(top, window.top + window.height), left : max(left, window.left + window.width)]
    part = np.full((window.height, window.width, *image.shape[2:]), beyond, np.uint8)
    row, column = top - window.top, left - window.left
    part[row : row + inside.shape[0], column : column + inside.shape[1]] = inside
    size = (round(window.width * window.times), round(window.height * window.times))
    return np.asarray(cv2.resize(part, size, interpolation=interpolation), np.uint8)


def _fixed(place: Array) -> tuple[int, int]:
    x, y = np.rint(place * 2**_SUBPIXEL).astype(int).tolist()
    return x, y
