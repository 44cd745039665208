"""Points followed from one image to the next: pyramidal Lucas-Kanade with a forward-backward check.

Lucas-Kanade takes a change of brightness for motion: 3 % are 0.15 px, and 20 % lose three tracks of four. Where gain or
exposure drift, both images are therefore brought to one brightness.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

_WINDOW = (11, 11)  # [px] of the matched patch; larger is steadier, slower and blurs depth edges
_PYRAMID_LEVELS = 3  # reach 60 px from the prediction, more than a limb's surprise in 1/30 s
_FORWARD_BACKWARD_PX = 0.8  # a point that does not return to within this is lost
_BRIGHTNESS_TOLERANCE = 0.01  # 1 % is 0.06 px
_MOST_COMPARISONS = 3  # a drift needs one; a jump by a fifth, which loses most points at first, two more

_STEPS = np.arange(-5.0, 6.0, 2.0, dtype=np.float32)  # [px] of the samples around a point, each way
_DARK = 8.0  # [grey levels] below it noise and black level dominate
_BRIGHT = 250.0  # above it the sensor is saturated
_LEAST_TRACKS = 20
_SIGMA_OF_MAD = 1.86  # standard deviation of a median over the median deviation, times the root of the count
_SURE = 6.0


def follow(
    previous: NDArray[np.uint8],
    current: NDArray[np.uint8],
    pixels: NDArray[np.float32],
    predicted: NDArray[np.float32],
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Follow points into the current image.

    Args:
        previous: (H, W) grey image in which ``pixels`` (N, 2) lie.
        current: (H, W) grey image.
        pixels: (N, 2) points in the previous image.
        predicted: (N, 2) their predicted places in the current image.

    Returns:
        (N, 2) points in the current image and (N,) whether each survived the check: found both ways, back within
        tolerance, inside the image.
    """
    if len(pixels) == 0:
        return pixels.reshape(-1, 2), np.zeros(0, bool)
    ratio, start = 1.0, predicted
    for _ in range(_MOST_COMPARISONS):
        images = (previous, current) if ratio == 1.0 else _evened(previous, current, ratio)
        found, alive = _follow_evened(*images, pixels, start)
        step = _brightness_ratio(*images, pixels[alive], found[alive])
        if abs(step - 1.0) <= _BRIGHTNESS_TOLERANCE:
            break
        ratio *= step
        start = np.where(alive[:, None], found, predicted).astype(np.float32)
    return found, alive


def _follow_evened(
    previous: NDArray[np.uint8],
    current: NDArray[np.uint8],
    pixels: NDArray[np.float32],
    predicted: NDArray[np.float32],
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Points in the current image and whether each survived, of two images of one brightness."""

    def flow(
        one: NDArray[np.uint8],
        other: NDArray[np.uint8],
        points: NDArray[np.float32],
        start: NDArray[np.float32],
        top: int,
    ) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
        found, status, _ = cv2.calcOpticalFlowPyrLK(
            one,
            other,
            points.reshape(-1, 1, 2),
            start.reshape(-1, 1, 2).copy(),
            winSize=_WINDOW,
            maxLevel=top,
            flags=cv2.OPTFLOW_USE_INITIAL_FLOW,
        )
        return np.asarray(found, np.float32).reshape(-1, 2), status.ravel() > 0

    forward, found = flow(previous, current, pixels, predicted, _PYRAMID_LEVELS)
    # The way back starts at the answer it should find, so the coarse levels have nothing to add.
    backward, found_back = flow(current, previous, forward, pixels, 0)
    height, width = current.shape
    returned = np.linalg.norm(backward - pixels, axis=1) < _FORWARD_BACKWARD_PX
    inside = ((forward >= 0) & (forward <= [width - 1, height - 1])).all(axis=1)
    return forward, found & found_back & returned & inside


def _brightness_ratio(
    previous: NDArray[np.uint8],
    current: NDArray[np.uint8],
    pixels_previous: NDArray[np.float32],
    pixels_current: NDArray[np.float32],
) -> float:
    """Brightness of the current image over that of the previous one: the median over the surroundings of points.

    It is 1 where too few points are neither black nor saturated, or where they disagree: light that changes does so
    everywhere.
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


def _evened(
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
