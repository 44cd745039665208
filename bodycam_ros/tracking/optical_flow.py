"""Following points from one image to the next: pyramidal Lucas-Kanade with a forward-backward check.

Gain and exposure drift; two images are brought to one brightness where they differ.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from bodycam_ros.settings import setting
from bodycam_ros.tracking.brightness import brightness_ratio, evened

_MOST_COMPARISONS = 3
"""Of a drift one is enough; of a jump by a fifth, which loses most points at first, two more find the rest."""


@dataclass(frozen=True)
class OpticalFlowSettings:
    """Window, depth of the pyramid and tolerance of the check."""

    window_px: int = setting(
        11,
        unit="px",
        limits=(5, 41),
        reason="side of the matched patch; larger is steadier, slower and blurs depth edges",
    )
    pyramid_levels: int = setting(
        3, limits=(0, 6), reason="3 reach 60 px from the prediction, more than a limb's surprise in 1/30 s"
    )
    forward_backward_px: float = setting(
        0.8, unit="px", limits=(0.05, 5.0), reason="a point that does not come back to within this is lost"
    )
    brightness_tolerance: float = setting(
        0.01,
        limits=(0.001, 1.0),
        reason="images whose brightness differs by more are evened and compared again; 1 % is 0.06 px",
    )


def follow(
    previous: NDArray[np.uint8],
    current: NDArray[np.uint8],
    pixels: NDArray[np.float32],
    predicted: NDArray[np.float32],
    settings: OpticalFlowSettings,
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Follow points into the current image.

    Args:
        previous: (H, W) grey image in which ``pixels`` (N, 2) lie.
        current: (H, W) grey image.
        pixels: (N, 2) points in the previous image.
        predicted: (N, 2) where they are expected in the current image.
        settings: window and tolerance.

    Returns:
        (N, 2) points in the current image and (N,) whether each survived the check: found both ways, back within
        tolerance, inside the image.
    """
    if len(pixels) == 0:
        return pixels.reshape(-1, 2), np.zeros(0, bool)
    ratio, start = 1.0, predicted
    for _ in range(_MOST_COMPARISONS):
        images = (previous, current) if ratio == 1.0 else evened(previous, current, ratio)
        found, alive = _compare(*images, pixels, start, settings)
        step = brightness_ratio(*images, pixels[alive], found[alive])
        if abs(step - 1.0) <= settings.brightness_tolerance:
            break
        ratio *= step
        start = np.where(alive[:, None], found, predicted).astype(np.float32)
    return found, alive


def _compare(
    previous: NDArray[np.uint8],
    current: NDArray[np.uint8],
    pixels: NDArray[np.float32],
    predicted: NDArray[np.float32],
    settings: OpticalFlowSettings,
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Points in the current image and whether each survived, of two images of one brightness."""
    window = (settings.window_px, settings.window_px)
    forward, found, _ = cv2.calcOpticalFlowPyrLK(
        previous,
        current,
        pixels.reshape(-1, 1, 2),
        predicted.reshape(-1, 1, 2).copy(),
        winSize=window,
        maxLevel=settings.pyramid_levels,
        flags=cv2.OPTFLOW_USE_INITIAL_FLOW,
    )
    # The way back starts at the answer it should find, so the coarse levels have nothing to add.
    backward, found_back, _ = cv2.calcOpticalFlowPyrLK(
        current,
        previous,
        forward,
        pixels.reshape(-1, 1, 2).copy(),
        winSize=window,
        maxLevel=0,
        flags=cv2.OPTFLOW_USE_INITIAL_FLOW,
    )
    forward = forward.reshape(-1, 2)
    height, width = current.shape
    returned = np.linalg.norm(backward.reshape(-1, 2) - pixels, axis=1) < settings.forward_backward_px
    inside = ((forward >= 0) & (forward <= [width - 1, height - 1])).all(axis=1)
    return forward, (found.ravel() > 0) & (found_back.ravel() > 0) & returned & inside
