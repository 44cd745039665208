"""An image at its own size and at halves of it, all in one array of bytes, as kernels read it.

Level k is smoothed (Burt and Adelson 1983) and its pixel (u, v) lies where the image has (2^k u, 2^k v).
"""

from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

LEVELS: Final = 5
"""Down to 1/16: patches of a coarse level reach into photographs of twice the scale."""


def pyramid_levels(height: int, width: int) -> NDArray[np.int64]:
    """(LEVELS, 3) where each level begins in the bytes, its height and its width."""
    levels, start = [], 0
    for _ in range(LEVELS):
        levels.append((start, height, width))
        start += height * width
        height, width = (height + 1) // 2, (width + 1) // 2
    return np.array(levels, np.int64)


def pyramid_size(levels: NDArray[np.int64]) -> int:
    """Bytes of a pyramid."""
    return int(levels[-1, 0] + levels[-1, 1] * levels[-1, 2])


def write_pyramid(image: NDArray[np.uint8], levels: NDArray[np.int64], into: NDArray[np.uint8]) -> None:
    """Fill ``into`` (bytes,) with the pyramid of a grey image (H, W)."""
    start, height, width = levels[0]
    into[: height * width] = image.ravel()
    for start, height, width in levels[1:]:
        smaller = into[start : start + height * width].reshape(height, width)
        image = np.asarray(cv2.pyrDown(image, dst=smaller), np.uint8)
