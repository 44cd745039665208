"""Where a browser looks from at first: half from the front, half from the body's left, a little from above."""

import numpy as np
from viser import ViserServer

from bodycam_ros.geometry import Array

_FIELD_OF_VIEW = np.radians(40.0)
_TURN = np.radians(40.0)  # from the front towards the body's left: limbs of both sides stay apart
_ELEVATION = np.radians(12.0)
_FILLED = 0.72  # share of the window's height that the body takes
_SMALLEST_M = 0.5  # of a body that is hardly one


def look_at_body(server: ViserServer, scene_T_root: Array, points_scene: Array) -> None:
    """Set the first camera position for browsers.

    Args:
        server: that they connect to.
        scene_T_root: (4, 4) pose of the body's root, whose x is forward, in the scene [m].
        points_scene: (N, 3) ends of its bones in the scene [m].
    """
    low, high = points_scene.min(axis=0), points_scene.max(axis=0)
    height = max(float((high - low).max()), _SMALLEST_M)
    centre = (low + high) / 2.0
    distance = height / _FILLED / (2.0 * np.tan(_FIELD_OF_VIEW / 2.0))
    azimuth = np.arctan2(scene_T_root[1, 0], scene_T_root[0, 0]) + _TURN
    away = np.array([np.cos(azimuth) * np.cos(_ELEVATION), np.sin(azimuth) * np.cos(_ELEVATION), np.sin(_ELEVATION)])
    camera = server.initial_camera
    camera.fov = float(_FIELD_OF_VIEW)
    camera.look_at = centre
    camera.position = centre + distance * away
    camera.up = np.array([0.0, 0.0, 1.0])
