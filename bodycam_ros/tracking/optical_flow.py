"""Points followed from one image to the next: pyramidal Lucas-Kanade with a forward-backward check.

Lucas-Kanade takes a change of brightness for motion: 3 % are 0.15 px, and 20 % lose three tracks of four. Descriptors
then find the landmarks anew, and patches of photographs have a gain of their own.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

_WINDOW = (11, 11)  # [px] of the matched patch; larger is steadier, slower and blurs depth edges
_PYRAMID_LEVELS = 3  # reach 60 px from the prediction, more than a limb's surprise in 1/30 s
_FORWARD_BACKWARD_PX = 0.8  # a point that does not return to within this is lost


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
