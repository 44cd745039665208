"""By how much a camera's picture moves between two images: what blurs it, whatever the exposure time is."""

import numpy as np
from numpy.typing import NDArray

_LEAST_TRACKS = 5


class ImageMotion:
    """Follows the tracks of one camera from image to image."""

    def __init__(self) -> None:
        self._ids = np.zeros(0, np.uint32)
        self._pixels = np.zeros((0, 2), np.float32)

    def add(self, track_ids: NDArray[np.uint32], pixels: NDArray[np.float32]) -> float:
        """The median length [px] that tracks (N,) at pixels (N, 2) moved since the image before; NaN of too few."""
        _, now, before = np.intersect1d(track_ids, self._ids, assume_unique=True, return_indices=True)
        moved = np.linalg.norm(pixels[now] - self._pixels[before], axis=1)
        self._ids, self._pixels = track_ids, pixels
        return float(np.median(moved)) if len(moved) >= _LEAST_TRACKS else float("nan")
