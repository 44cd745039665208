"""Where a browser looks from at first: half from the front, half from the body's left, a little from above."""

from dataclasses import dataclass

import numpy as np

from bodycam_ros.geometry import Array

FIELD_OF_VIEW = float(np.radians(40.0))
"""Of the browser's camera, from bottom to top [rad]."""

_TURN = np.radians(40.0)  # from the front towards the body's left: limbs of both sides stay apart
_ELEVATION = np.radians(12.0)
_FILLED = 0.72  # share of the window's height that the body takes
_SMALLEST_M = 0.5  # of a body that is hardly one


@dataclass(frozen=True, eq=False)
class OpeningView:
    """A camera whose up is z.

    Attributes:
        position: (3,) in the scene [m].
        look_at: (3,) what is in the middle of the window [m].
    """

    position: Array
    look_at: Array

    @classmethod
    def of_body(cls, scene_T_root: Array, ends_scene: Array) -> "OpeningView":
        """The view of a body.

        Args:
            scene_T_root: (4, 4) pose of its root, whose x is forward [m].
            ends_scene: (N, 3) ends of its bones [m].
        """
        low, high = ends_scene.min(axis=0), ends_scene.max(axis=0)
        size = max(float((high - low).max()), _SMALLEST_M)
        distance = size / _FILLED / (2.0 * np.tan(FIELD_OF_VIEW / 2.0))
        azimuth = np.arctan2(scene_T_root[1, 0], scene_T_root[0, 0]) + _TURN
        level = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
        away = np.cos(_ELEVATION) * level + np.sin(_ELEVATION) * np.array([0.0, 0.0, 1.0])
        centre = (low + high) / 2.0
        return cls(centre + distance * away, centre)
