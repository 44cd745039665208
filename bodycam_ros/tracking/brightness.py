"""By how much the light of a camera's picture changed between two images: exposure and gain that drift or jump.

Lucas-Kanade takes a change of brightness for motion: 3 % are 0.15 px, and 20 % lose three tracks of four.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

_STEPS = np.arange(-5.0, 6.0, 2.0, dtype=np.float32)  # [px] of the samples around a point, each way
_DARK = 8.0  # [grey levels] below it noise and black level are most of what is seen
_BRIGHT = 250.0  # above it the sensor is saturated
_LEAST_TRACKS = 20
_SIGMA_OF_MAD = 1.86  # standard deviation of a median over the median deviation, times the root of the count
_SURE = 6.0


def brightness_ratio(
    previous: NDArray[np.uint8],
    current: NDArray[np.uint8],
    pixels_previous: NDArray[np.float32],
    pixels_current: NDArray[np.float32],
) -> float:
    """Brightness of the current image over that of the previous one: the median over what surrounds points.

    Args:
        previous, current: (H, W) grey images.
        pixels_previous, pixels_current: (N, 2) the same points in both.

    Returns:
        The ratio, or 1 where too few points are neither black nor saturated, or where they do not agree: light that
        changes does so everywhere.
    """
    if len(pixels_previous) < _LEAST_TRACKS:
        return 1.0
    before, after = _surroundings(previous, pixels_previous), _surroundings(current, pixels_current)
    usable = (np.minimum(before, after) > _DARK) & (np.maximum(before, after) < _BRIGHT)
    if usable.sum() < _LEAST_TRACKS:
        return 1.0
    change = np.log(after[usable] / before[usable])
    middle = float(np.median(change))
    spread = _SIGMA_OF_MAD * float(np.median(np.abs(change - middle))) / np.sqrt(len(change))
    return float(np.exp(middle)) if abs(middle) > _SURE * spread else 1.0


def evened(
    previous: NDArray[np.uint8], current: NDArray[np.uint8], ratio: float
) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """Both images (H, W) at one brightness; the brighter one is darkened, so that nothing saturates."""
    if ratio > 1.0:
        return previous, np.asarray(cv2.convertScaleAbs(current, alpha=1.0 / ratio), np.uint8)
    return np.asarray(cv2.convertScaleAbs(previous, alpha=ratio), np.uint8), current


def _surroundings(image: NDArray[np.uint8], pixels: NDArray[np.float32]) -> NDArray[np.float64]:
    """Mean grey levels (N,) around pixels (N, 2), between pixels too: beside an edge half a pixel is some per cent."""
    columns = pixels[:, 0, None, None] + _STEPS + np.zeros_like(_STEPS)[:, None]
    rows = pixels[:, 1, None, None] + _STEPS[:, None] + np.zeros_like(_STEPS)
    shape = (len(pixels), len(_STEPS) ** 2)
    samples = cv2.remap(
        image, columns.reshape(shape), rows.reshape(shape), cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
    )
    means: NDArray[np.float64] = samples.mean(axis=1)
    return means
