"""A parallel projection that shows a walking person from the side, a little from the front and from above."""

from dataclasses import dataclass

import numpy as np

from bodycam_ros.geometry import Array

_TURN_WALKING = np.radians(20.0)  # from the side towards the front: both legs and arms stay apart
_TURN_STANDING = np.radians(50.0)  # who moves limbs in all directions is better seen half from the front
_ELEVATION = np.radians(14.0)  # enough to see the path on the floor
_STANDING_M = 1.5  # who moves less than this stands: the view then follows where the root faces


@dataclass(frozen=True, eq=False)
class ObliqueView:
    """Screen axes in a world whose z is up.

    Attributes:
        right: (3,) unit vector to the right.
        up: (3,) unit vector upwards on the screen.
    """

    right: Array
    up: Array

    @classmethod
    def of_path(cls, world_T_root: Array) -> "ObliqueView":
        """The view of a root that takes a path (T, 4, 4); it goes to the right."""
        ground = world_T_root[:, :2, 3]
        centred = ground - ground.mean(axis=0)
        _, _, directions = np.linalg.svd(centred, full_matrices=False)
        along = centred @ directions[0]
        heading = directions[0] * (1.0 if along[-1] >= along[0] else -1.0)
        turn = _TURN_WALKING
        if np.ptp(along) < _STANDING_M:
            heading, turn = world_T_root[:, :2, 0].mean(axis=0), _TURN_STANDING
        azimuth = np.arctan2(heading[1], heading[0]) + turn
        right = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
        away = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
        return cls(right, np.sin(_ELEVATION) * away + np.cos(_ELEVATION) * np.array([0.0, 0.0, 1.0]))

    def project(self, points: Array) -> Array:
        """Screen positions (..., 2) [m] of points (..., 3) [m]."""
        screen: Array = np.stack([points @ self.right, points @ self.up], axis=-1)
        return screen

    def depth(self, points: Array) -> Array:
        """How far (...) points (..., 3) are from the viewer [m], up to a constant."""
        depth: Array = points @ np.cross(self.up, self.right)
        return depth
