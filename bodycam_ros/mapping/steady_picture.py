"""A picture whose rows were read out one after the other, as it would be had all been exposed with the middle one.

The rows of a camera that lay on its side are columns of the upright picture.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.geometry import exp_so3

Array = NDArray[np.float64]

_ROWS_AT_ONCE = 200  # bounds the memory that a large picture takes
_REFINEMENTS = 2


def steady_picture(
    picture: NDArray[np.uint8], camera: CameraModel, angular_velocity: Array, readout_s: tuple[float, float]
) -> NDArray[np.uint8]:
    """Undo what the camera's turning did to a picture while it was read out.

    What it did by moving on is left: of things that are metres away it is a tenth of that.

    Args:
        picture: (H, W) or (H, W, 3) pixels.
        camera: its lens.
        angular_velocity: (3,) in camera axes [rad/s].
        readout_s: by how much later the right border was exposed than the left, and the lower than the upper [s].
    """
    source = np.empty((camera.height, camera.width, 2), np.float32)
    for top in range(0, camera.height, _ROWS_AT_ONCE):
        rows = np.arange(top, min(top + _ROWS_AT_ONCE, camera.height))
        columns, lines = np.meshgrid(np.arange(camera.width), rows)
        steady = np.column_stack([columns.ravel(), lines.ravel()]).astype(np.float64)
        shown = steady
        # Where a pixel was shown depends on the row that it was shown in.
        for _ in range(_REFINEMENTS):
            shown = shown + (steady - _steady_pixels(camera, shown, angular_velocity, readout_s))
        source[rows] = shown.reshape(len(rows), camera.width, 2)
    straight = cv2.remap(picture, source, np.empty(0), cv2.INTER_CUBIC, borderMode=cv2.BORDER_CONSTANT)
    return np.asarray(straight, np.uint8)


def _steady_pixels(
    camera: CameraModel, pixels: Array, angular_velocity: Array, readout_s: tuple[float, float]
) -> Array:
    """Where pixels (M, 2) would be if all were exposed with the middle of the picture."""
    bearings, in_view = camera.unproject(pixels)
    later_s = (pixels / [camera.width - 1, camera.height - 1] - 0.5) @ np.array(readout_s)
    turns = exp_so3(later_s[:, None] * angular_velocity)
    steady, valid = camera.project((turns @ bearings[:, :, None])[:, :, 0])
    return np.where((in_view & valid)[:, None], steady, pixels)
