"""Paints into a station's image what its lines are about: surface, visible contour, and forces on it (B figures 2, 7).

A force is how far a line would move the contour: outward cyan, inward red, several times enlarged.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from bodycam_ros.geometry import Array
from bodycam_ros.picture_style import FAINT
from bodycam_ros.static_cameras.contour_kernels import NOBODY
from bodycam_ros.static_cameras.station import SHRINK, Contour

Image = NDArray[np.uint8]

CONTOUR, SILENT = "#ffe14d", "#8f8f86"
"""A point of the contour, and one whose line does not know where to move it."""

OUTWARD, INWARD = "#12d9ff", "#ff2a1f"

ENLARGED = 4.0
"""How many times longer than the way that a line would move the contour its force is drawn."""

_TINT = 0.28  # share of the surface's colour in the image
_SUBPIXEL = 4  # bits
_THICK_PX, _RADIUS_PX = 2, 2.2  # of lines and points in the picture, however much it is magnified
_LEAST_FORCE_PX = 0.15  # below it, a force is not there to be seen


@dataclass(frozen=True)
class Window:
    """A part of an image, and how many times it is magnified.

    Attributes:
        left, top, width, height: of the part [px of the image].
        times: pixels of the picture, across, that are one of the image.
    """

    left: int
    top: int
    width: int
    height: int
    times: int

    def place(self, pixels: Array) -> Array:
        """Where pixels (..., 2) of the image are in the picture."""
        placed: Array = (pixels - [self.left, self.top] + 0.5) * self.times - 0.5
        return placed


def paint_contour(image: Image, contour: Contour, shifts: Array, colours: Sequence[str], window: Window) -> Image:
    """A part of a station's image with the body painted into it: (height, width, 3) times magnified.

    Args:
        image: (H, W, 3) blue, green, red.
        contour: of the body in it.
        shifts: (N,) how far outward of its points the image has it [px]; NaN where no line measures it.
        colours: of the segments' surfaces, as ``#rrggbb``.
        window: the part that is shown.
    """
    picture = _magnified(_tinted(image, contour, colours), window)
    places = window.place(contour.pixels)
    ends = places + window.times * ENLARGED * np.nan_to_num(shifts)[:, None] * contour.normals
    for place, end, shift in zip(places, ends, shifts.tolist(), strict=True):
        if abs(shift) > _LEAST_FORCE_PX:
            colour = bgr(OUTWARD if shift > 0.0 else INWARD)
            cv2.line(picture, _fixed(place), _fixed(end), colour, _THICK_PX, cv2.LINE_AA, _SUBPIXEL)
    radius = round(2**_SUBPIXEL * _RADIUS_PX)
    for place, shift in zip(places, shifts.tolist(), strict=True):
        colour = bgr(SILENT if np.isnan(shift) else CONTOUR)
        cv2.circle(picture, _fixed(place), radius, colour, cv2.FILLED, cv2.LINE_AA, _SUBPIXEL)
    return picture


def bgr(colour: str) -> tuple[int, int, int]:
    """Blue, green and red, 0 to 255, of ``#rrggbb``."""
    red, green, blue = bytes.fromhex(colour.removeprefix("#"))
    return blue, green, red


def _tinted(image: Image, contour: Contour, colours: Sequence[str]) -> Image:
    """The image with the surface over it, half transparent."""
    table = np.array([bgr(colour) for colour in colours], np.float64)
    labels = contour.labels.repeat(SHRINK, axis=0).repeat(SHRINK, axis=1)
    picture = image.copy()
    part = picture[: labels.shape[0], : labels.shape[1]]
    shown = labels != NOBODY
    part[shown] = ((1.0 - _TINT) * part[shown] + _TINT * table[labels[shown]]).astype(np.uint8)
    return picture


def _magnified(image: Image, window: Window) -> Image:
    """A part of an image; what lies beyond its borders is grey."""
    top, left = max(window.top, 0), max(window.left, 0)
    inside = image[top : max(top, window.top + window.height), left : max(left, window.left + window.width)]
    part = np.full((window.height, window.width, 3), bgr(FAINT), np.uint8)
    row, column = top - window.top, left - window.left
    part[row : row + inside.shape[0], column : column + inside.shape[1]] = inside
    size = (window.width * window.times, window.height * window.times)
    return np.asarray(cv2.resize(part, size, interpolation=cv2.INTER_LINEAR), np.uint8)


def _fixed(place: Array) -> tuple[int, int]:
    x, y = np.rint(place * 2**_SUBPIXEL).astype(int).tolist()
    return x, y
