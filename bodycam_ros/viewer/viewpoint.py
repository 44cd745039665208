"""Where a body is seen from when a view or a film begins, and the lines of the floor that it stands on."""

from typing import NamedTuple

import numpy as np

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.stick_figure import body_bones
from bodycam_ros.geometry import Array
from bodycam_ros.viewer.motion import mounted_camera


def grid_lines(low: Array, high: Array, offset_m: float = 0.0) -> Array:
    """(L, 2, 3) lines of the floor a metre apart between corners (2,), (2,), the first so far from the lower [m]."""
    x, y = (np.arange(start + offset_m, end + 1e-6) for start, end in zip(low, high, strict=True))
    return np.array(
        [
            *([[at, low[1], 0.0], [at, high[1], 0.0]] for at in x),
            *([[low[0], at, 0.0], [high[0], at, 0.0]] for at in y),
        ]
    )


FIELD_OF_VIEW = float(np.radians(40.0))
"""Field of view of the browser's camera, from bottom to top [rad]."""

_TURN = np.radians(40.0)  # from the front towards the body's left: limbs of both sides stay apart
_ELEVATION = np.radians(12.0)
_FILLED = 0.8  # share of the window's height that the body takes
_SMALLEST_BODY_M = 0.5  # of a body of few segments


class OpeningView(NamedTuple):
    """A camera whose up is z: half from the front, half from the body's left, a little from above.

    Attributes:
        position: (3,) in the scene [m].
        look_at: (3,) what is in the middle of the window [m].
    """

    position: Array
    look_at: Array

    @classmethod
    def of_body(cls, scene_T_root: Array, points_scene: Array) -> "OpeningView":
        """The viewpoint of a body.

        Args:
            scene_T_root: (4, 4) pose of its root, whose x is forward [m].
            points_scene: (N, 3) what is to be in view [m].
        """
        low, high = points_scene.min(axis=0), points_scene.max(axis=0)
        size = max(float((high - low).max()), _SMALLEST_BODY_M)
        distance = size / _FILLED / (2.0 * np.tan(FIELD_OF_VIEW / 2.0))
        azimuth = np.arctan2(scene_T_root[1, 0], scene_T_root[0, 0]) + _TURN
        level = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
        away = np.cos(_ELEVATION) * level + np.sin(_ELEVATION) * np.array([0.0, 0.0, 1.0])
        centre = (low + high) / 2.0
        return cls(centre + distance * away, centre)


def points_to_see(body: BodyModel, world_T_segment: Array) -> Array:
    """(N, 3) ends of bones, and cameras, of a body at poses (S, 4, 4) [m]."""
    limbs = body_bones(body, world_T_segment)
    cameras = [mounted_camera(body, world_T_segment, camera)[:3, 3] for camera in body.mounts]
    return np.concatenate([*(end for limb in limbs for end in (limb.start, limb.end)), np.reshape(cameras, (-1, 3))])
