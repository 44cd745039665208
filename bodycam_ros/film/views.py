"""Where a film is seen from: views from outside that move with the person, and their lens."""

import numpy as np
from scipy.ndimage import uniform_filter1d

from bodycam_ros.camera import CameraModel
from bodycam_ros.geometry import Array, rigid

FOLLOW, ORBIT, FIXED = "follow", "orbit", "fixed"
OUTSIDE = (FOLLOW, ORBIT, FIXED)
"""Views from outside: beside the person, around them, and from one place that sees all of the motion."""

_FIELD_OF_VIEW = float(np.radians(32.0))  # from top to bottom
_FILLED = 0.62  # of the height, by the person
_TURN = np.radians(40.0)  # from the front towards the body's left: limbs of both sides stay apart
_ELEVATION = np.radians(9.0)
_SMOOTHED_S = 1.4  # the view follows the mean of the path over this time
_ORBIT_RATE = np.radians(18.0)  # [rad/s], or faster where the film is short
_LEAST_ORBIT = np.radians(100.0)  # in the whole film
_MARGIN_M = 0.5  # of a fixed view, around the motion


UP = np.array([0.0, 0.0, 1.0])


def outside_lens(width: int, height: int) -> CameraModel:
    """A lens without distortion for pictures of a size [px]."""
    focal = 0.5 * height / float(np.tan(0.5 * _FIELD_OF_VIEW))
    middle = 0.5 * (width - 1), 0.5 * (height - 1)
    return CameraModel("outside", width, height, focal, focal, *middle, (0.0,) * 5, "plumb_bob")


def outside_poses(
    kind: str, seconds: Array, heading: Array, low: Array, high: Array, aspect: float, up: Array
) -> Array:
    """Poses world_T_camera (F, 4, 4) of a view from outside [m].

    Args:
        kind: one of ``OUTSIDE``.
        seconds: (F,) evenly spaced times.
        heading: (3,) where the person faces.
        low, high: (F, 3) corners of a box around the person [m].
        aspect: width of the picture over its height.
        up: (3,) what is up in the picture.
    """
    step_s = (seconds[-1] - seconds[0]) / max(1, len(seconds) - 1)
    middles = 0.5 * (low + high)
    middles[:, 2] = np.median(middles[:, 2])
    size = float(np.median(high[:, 2] - low[:, 2]))
    azimuth = np.full(len(seconds), np.arctan2(heading[1], heading[0]) + _TURN)
    if kind == FIXED:
        first, last = low.min(axis=0), high.max(axis=0)
        middles = np.broadcast_to(0.5 * (first + last), middles.shape)
        across = float(np.linalg.norm((last - first)[:2])) + _MARGIN_M
        size = max(size, across / aspect, float(last[2] - first[2]))
    else:
        window = max(1, round(_SMOOTHED_S / step_s)) if step_s else 1
        middles = uniform_filter1d(middles, window, axis=0, mode="nearest")
    if kind == ORBIT:
        azimuth -= (seconds - seconds[0]) * max(_ORBIT_RATE, _LEAST_ORBIT / max(1e-3, seconds[-1] - seconds[0]))
    distance = size / _FILLED / (2.0 * np.tan(0.5 * _FIELD_OF_VIEW))
    level = np.cos(_ELEVATION) * np.stack([np.cos(azimuth), np.sin(azimuth)], axis=1)
    away = np.column_stack([level, np.full(len(level), np.sin(_ELEVATION))])
    return np.stack(
        [looking_at(middle + distance * one, middle, up) for middle, one in zip(middles, away, strict=True)]
    )


def looking_at(position: Array, look_at: Array, up: Array = UP) -> Array:
    """(4, 4) pose of a camera's optical frame (x right, y down, z ahead) at a point (3,), up a unit vector (3,) [m]."""
    ahead = (look_at - position) / np.linalg.norm(look_at - position)
    right = np.cross(ahead, up)
    right /= np.linalg.norm(right)
    pose: Array = rigid(np.stack([right, np.cross(ahead, right), ahead], axis=1), position)
    return pose


Window = tuple[int, int, int, int]
"""Left, top, width and height of an image within a picture [px]."""


def fitted_window(width: int, height: int, size: tuple[int, int]) -> Window:
    """Where an image of a width and height [px] is in a picture of a size, as large as it fits, in the middle."""
    scale = min(size[0] / width, size[1] / height)
    inner_width, inner_height = round(width * scale), round(height * scale)
    return (size[0] - inner_width) // 2, (size[1] - inner_height) // 2, inner_width, inner_height


def fitted_lens(lens: CameraModel, size: tuple[int, int]) -> CameraModel:
    """The lens of a picture of a size (width, height) [px] that has the image of another one in its window."""
    left, top, width, height = fitted_window(lens.width, lens.height, size)
    x, y = width / lens.width, height / lens.height
    return CameraModel(
        lens.name,
        *size,
        lens.fx * x,
        lens.fy * y,
        (lens.cx + 0.5) * x - 0.5 + left,
        (lens.cy + 0.5) * y - 0.5 + top,
        lens.distortion,
        lens.distortion_model,
    )
