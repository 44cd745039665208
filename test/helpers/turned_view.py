"""What a camera sees that turns in front of a texture far away."""

import cv2
import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import camera_from_info

WIDTH = 640
HEIGHT = 480
FOCAL = 500.0
CAMERA = camera_from_info(
    "hand", WIDTH, HEIGHT, "plumb_bob", [], [FOCAL, 0, (WIDTH - 1) / 2, 0, FOCAL, (HEIGHT - 1) / 2, 0, 0, 1]
)
_TEXTURE = cv2.resize(
    np.random.default_rng(2).integers(0, 256, (700, 700), np.uint8), (2800, 2800), interpolation=cv2.INTER_CUBIC
)


def turned_view(pan_deg: float, tilt_deg: float = 0.0) -> NDArray[np.uint8]:
    """The picture of CAMERA that has turned to the right, then up."""
    pan, tilt = np.radians([pan_deg, tilt_deg])
    turn = cv2.Rodrigues(np.array([0.0, pan, 0.0]))[0] @ cv2.Rodrigues(np.array([tilt, 0.0, 0.0]))[0]
    k = np.array([[FOCAL, 0, (WIDTH - 1) / 2], [0, FOCAL, (HEIGHT - 1) / 2], [0, 0, 1]])
    plane = np.array([[FOCAL, 0, 1400], [0, FOCAL, 1400], [0, 0, 1]])
    from_texture = k @ turn.T @ np.linalg.inv(plane)
    return np.asarray(cv2.warpPerspective(_TEXTURE, from_texture, (WIDTH, HEIGHT)), np.uint8)


def rolled_view(
    pan_deg: float, tilt_deg: float, rate_deg: tuple[float, float], readout_s: tuple[float, float], lines: int = 8
) -> NDArray[np.uint8]:
    """The same while it turns on by (pan, tilt) [deg/s], and is read out to the right or down, some lines together."""
    picture = np.empty((HEIGHT, WIDTH), np.uint8)
    across = readout_s[0] != 0.0
    count = WIDTH if across else HEIGHT
    for first in range(0, count, lines):
        at_s = sum(readout_s) * ((first + 0.5 * (lines - 1)) / (count - 1) - 0.5)
        turned = turned_view(pan_deg + at_s * rate_deg[0], tilt_deg + at_s * rate_deg[1])
        part = np.s_[:, first : first + lines] if across else np.s_[first : first + lines]
        picture[part] = turned[part]
    return picture
