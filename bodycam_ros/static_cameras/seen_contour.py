"""The visible contour of a body in an image, and where the image would rather have it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.geometry import Array
from bodycam_ros.static_cameras.contour_kernels import NOBODY


@dataclass(frozen=True, eq=False)
class SeenContour:
    """N points along the visible contours of all segments.

    Attributes:
        pixels: (N, 2) where they are.
        normals: (N, 2) unit vectors away from their segments, in the image.
        segments: (N,) whose they are.
        shifts: (N,) how far along its normal the image would rather have each [px]; NaN where it cannot tell.
        labels: (h, w) the segment that is in front, at a part of the image's resolution; ``NOBODY`` beside the body.
        shrink: pixels of the image, across, that are one of the labels.
    """

    pixels: Array
    normals: Array
    segments: NDArray[np.int64]
    shifts: Array
    labels: NDArray[np.uint8]
    shrink: int

    @property
    def covered(self) -> Array | None:
        """(2, 2) least and greatest pixel that shows the body; None where none does."""
        rows, columns = np.nonzero(self.labels != NOBODY)
        if not len(rows):
            return None
        least = np.array([columns.min(), rows.min()], np.float64)
        return self.shrink * np.stack([least, np.array([columns.max() + 1, rows.max() + 1])])
