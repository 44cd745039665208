"""Which pixels look at most so far from the optical axis: the rim is projected, and only pixels near it are asked."""

import cv2
import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel

_RIM_SAMPLES = 1440
"""Between two of them a rim of 2000 px radius bends by 0.005 px."""

_NEAR_PX = 5  # width of the band along the rim whose pixels are asked
_FAR = 4.0  # image sizes from the principal point: what is farther is drawn there


def view_mask(camera: CameraModel, max_view_angle_deg: float) -> NDArray[np.uint8]:
    """(H, W) mask, 255 where a pixel looks at most this far from the optical axis."""
    max_angle = np.radians(max_view_angle_deg)
    rim = _rim(camera, min(max_angle, camera.max_angle)).round().astype(np.int32)
    mask, near = np.zeros((2, camera.height, camera.width), np.uint8)
    cv2.fillPoly(mask, [rim], 255)
    cv2.polylines(near, [rim], isClosed=True, color=255, thickness=_NEAR_PX)
    rows, columns = np.nonzero(near)
    bearings, valid = camera.unproject(np.column_stack([columns, rows]))
    mask[rows, columns] = np.where(valid & (bearings[:, 2] > np.cos(max_angle)), 255, 0)
    return mask


def _rim(camera: CameraModel, angle: float) -> NDArray[np.float64]:
    """Pixels (N, 2) of all that is at an angle to the axis [rad], drawn in to where it is surely out of the image."""
    turn = np.linspace(0.0, 2.0 * np.pi, _RIM_SAMPLES, endpoint=False)
    bearings = np.column_stack(
        [np.sin(angle) * np.cos(turn), np.sin(angle) * np.sin(turn), np.full(_RIM_SAMPLES, np.cos(angle))]
    )
    centre = np.array([camera.cx, camera.cy])
    outwards = camera.project(bearings)[0] - centre
    reach = np.linalg.norm(outwards, axis=1, keepdims=True)
    farthest = _FAR * (camera.width + camera.height)
    rim: NDArray[np.float64] = centre + outwards * np.minimum(1.0, farthest / np.maximum(reach, 1.0))
    return rim
