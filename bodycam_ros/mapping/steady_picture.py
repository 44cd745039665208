"""Pictures without the effect of their read-out: rows are exposed one after the other while a camera turns."""

import cv2
import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.geometry import Array, log_so3
from bodycam_ros.registration.pose_fit import turned_pixels
from bodycam_ros.tracking.optical_flow import follow
from bodycam_ros.tracking.rotation import estimate_rotation

_FLOW_WIDTH = 480  # [px] to which images are reduced for their rotation
_POINTS, _SPACING = 200, 0.02  # that are followed, and their distance as a share of the width
_ROWS_AT_ONCE = 200  # bounds the memory that a large picture takes
_ITERATIONS = 2


def camera_turn(camera: CameraModel, before: NDArray[np.uint8], after: NDArray[np.uint8]) -> Array:
    """Rotation vector (3,) [rad] of a camera from one image (H, W) to the next, in its axes (A eq. 2); 0 if unknown."""
    scale = min(1.0, _FLOW_WIDTH / camera.width)
    small = [
        np.asarray(cv2.resize(grey, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA), np.uint8)
        for grey in (before, after)
    ]
    corners = cv2.goodFeaturesToTrack(small[0], _POINTS, 0.01, _SPACING * small[0].shape[1])
    pixels = np.zeros((0, 2), np.float32) if corners is None else np.asarray(corners, np.float32).reshape(-1, 2)
    moved, alive = follow(small[0], small[1], pixels, pixels)
    (first, known), (second, known_too) = (camera.unproject((p + 0.5) / scale - 0.5) for p in (pixels, moved))
    used = alive & known & known_too
    return log_so3(estimate_rotation(first[used], second[used], seed=0)[0].T)


def steady_picture(
    picture: NDArray[np.uint8], camera: CameraModel, angular_velocity: Array, readout_s: tuple[float, float]
) -> NDArray[np.uint8]:
    """Undo the effect of the camera's rotation during read-out; that of its translation is a tenth of it.

    Args:
        picture: (H, W) or (H, W, 3) pixels.
        camera: its lens.
        angular_velocity: (3,) in camera axes [rad/s].
        readout_s: delay of the right border against the left, and of the lower against the upper [s].
    """
    source = np.empty((camera.height, camera.width, 2), np.float32)
    for top in range(0, camera.height, _ROWS_AT_ONCE):
        rows = np.arange(top, min(top + _ROWS_AT_ONCE, camera.height))
        columns, lines = np.meshgrid(np.arange(camera.width), rows)
        steady = np.column_stack([columns.ravel(), lines.ravel()]).astype(np.float64)
        shown = steady
        # The place of a pixel depends on the row in which it was exposed.
        for _ in range(_ITERATIONS):
            later_s = (shown / [camera.width - 1, camera.height - 1] - 0.5) @ np.array(readout_s)
            shown = shown + (steady - turned_pixels(camera, shown, later_s[:, None] * angular_velocity))
        source[rows] = shown.reshape(len(rows), camera.width, 2)
    straight = cv2.remap(picture, source, np.empty(0), cv2.INTER_CUBIC, borderMode=cv2.BORDER_CONSTANT)
    return np.asarray(straight, np.uint8)
