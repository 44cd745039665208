"""What is on a board: AprilTags in a grid, a ChArUco board, or a checkerboard, by its measures.

The board frame is x right, y to the top row, z out of the face, with the origin in the middle; metres.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from bodycam_ros.geometry import Array

APRILTAG, CHARUCO, CHECKERBOARD = KINDS = ("apriltag", "charuco", "checkerboard")

_SQUARE = np.array([[-0.5, 0.5], [0.5, 0.5], [0.5, -0.5], [-0.5, -0.5]])
"""Corners of a tag in the order of cv2.aruco: clockwise from the upper left of the print."""

_CELL = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])  # of a tag, by columns and rows


@dataclass(frozen=True)
class BoardLayout:
    """A board of equal parts in rows and columns.

    Attributes:
        kind: of ``KINDS``.
        columns, rows: of tags; or of squares, the outermost included.
        pitch_m: (2,) from one tag or square to the next, to the right and upwards [m].
        tag_m: (2,) sides of a tag [m]; zero on a checkerboard.
        dictionary: number of the tags' family in ``cv2.aruco``; None on a checkerboard.
        first_tag: number of the upper left tag; they go on row by row.
        upper_left_is_black: of squares.
        given_tags: tag -> corners of a file that has these alone, in place of those by the measures.
    """

    kind: str
    columns: int
    rows: int
    pitch_m: tuple[float, float]
    tag_m: tuple[float, float] = (0.0, 0.0)
    dictionary: int | None = None
    first_tag: int = 0
    upper_left_is_black: bool = True
    given_tags: Mapping[int, Array] | None = None

    @cached_property
    def tags(self) -> Mapping[int, Array]:
        """Tag -> its four corners (4, 3) [m], in the order of cv2.aruco."""
        if self.given_tags is not None:
            return self.given_tags
        if self.kind == CHECKERBOARD:
            return {}
        is_tag = np.ones((self.rows, self.columns), dtype=bool) if self.kind == APRILTAG else ~self.black_squares
        return {
            self.first_tag + number: np.column_stack([_SQUARE * self.tag_m + self._centre(row, column), np.zeros(4)])
            for number, (row, column) in enumerate(np.argwhere(is_tag).tolist())
        }

    @property
    def black_squares(self) -> NDArray[np.bool_]:
        """Which squares (rows, columns) are black."""
        rows, columns = np.indices((self.rows, self.columns))
        black: NDArray[np.bool_] = ((rows + columns) % 2 == 0) == self.upper_left_is_black
        return black

    @cached_property
    def inner_corners(self) -> Array:
        """Where squares meet (N, 3) [m], row by row from the upper left; none on a board of tags alone."""
        if self.kind == APRILTAG:
            return np.zeros((0, 3))
        rows, columns = np.mgrid[1 : self.rows, 1 : self.columns]
        x = (columns.ravel() - 0.5 * self.columns) * self.pitch_m[0]
        y = (0.5 * self.rows - rows.ravel()) * self.pitch_m[1]
        return np.column_stack([x, y, np.zeros(len(x))])

    def outlines(self) -> list[Array]:
        """Loops (N, 2) [m] that, filled where they wind, are what is black."""
        loops = []
        if self.kind != APRILTAG:
            loops += [self._centre(r, c) + _SQUARE * self.pitch_m for r, c in np.argwhere(self.black_squares).tolist()]
        if self.dictionary is not None:
            dictionary = cv2.aruco.getPredefinedDictionary(self.dictionary)
            for tag, corners in self.tags.items():
                black = ~tag_cells(dictionary, tag)
                cell = np.array(self.tag_m) / black.shape[0] * [1.0, -1.0]
                loops += [corners[0, :2] + (_CELL + [column, row]) * cell for row, column in np.argwhere(black)]
        return loops

    def _centre(self, row: int, column: int) -> Array:
        """Centre of a tag or square (2,) [m]."""
        return (np.array([column, -row]) + [0.5 - 0.5 * self.columns, 0.5 * self.rows - 0.5]) * self.pitch_m


def tag_cells(dictionary: cv2.aruco.Dictionary, tag: int) -> NDArray[np.bool_]:
    """Which cells of a tag are white, its black border included."""
    size = dictionary.markerSize + 2
    draw = getattr(cv2.aruco, "generateImageMarker", None) or cv2.aruco.drawMarker
    return np.asarray(draw(dictionary, tag, size), np.uint8) > 127


def tags_in(dictionary: int) -> int:
    """How many tags a family of ``cv2.aruco`` has."""
    return len(cv2.aruco.getPredefinedDictionary(dictionary).bytesList)
