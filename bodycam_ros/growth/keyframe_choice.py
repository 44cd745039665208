"""When a worn camera should look for features that the map may grow by."""

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.growth.growth_settings import GrowthSettings
from bodycam_ros.registration.landmark_matches import LandmarkMatches

_CELLS = 8
_WELL_WITHIN = 0.97
"""Of the lens's cone: landmarks are not found at its very rim."""


class KeyframeChoice:
    """Chooses the keyframes of one camera.

    Args:
        camera: its model.
        settings: how far it moves between two.
    """

    def __init__(self, camera: CameraModel, settings: GrowthSettings) -> None:
        self._settings = settings
        self._size = np.array([camera.width, camera.height], np.float64)
        centres = (np.stack(np.meshgrid(*[np.arange(_CELLS)] * 2), axis=-1).reshape(-1, 2) + 0.5) / _CELLS * self._size
        bearings, in_view = camera.unproject(centres)
        self._in_view: NDArray[np.bool_] = in_view & (bearings[:, 2] > np.cos(_WELL_WITHIN * camera.max_angle))
        self._latest_ns: int | None = None
        self._world_T_latest = np.eye(4)

    def taken(self, matches: LandmarkMatches) -> None:
        """The image became a keyframe."""
        if matches.world_T_camera is not None:
            self._latest_ns, self._world_T_latest = matches.stamp_ns, matches.world_T_camera

    def is_due(self, matches: LandmarkMatches) -> bool:
        """Whether the next image should be a keyframe: the camera is registered, sees unknown things, and has moved."""
        pose = matches.world_T_camera
        if pose is None or self.coverage(matches) >= self._settings.covered:
            return False
        if self._latest_ns is None:
            return True
        if 0 <= matches.stamp_ns - self._latest_ns < 1e9 * self._settings.keyframe_gap:
            return False
        return has_moved(self._world_T_latest, pose, self._settings)

    def coverage(self, matches: LandmarkMatches) -> float:
        """Share of the view, 0 to 1, in which landmarks were found."""
        column, row = np.clip((_CELLS * matches.shown / self._size).astype(np.int64), 0, _CELLS - 1).T
        found = np.unique(_CELLS * row + column)
        return float(self._in_view[found].sum() / max(1, self._in_view.sum()))


def has_moved(
    world_T_before: NDArray[np.float64], world_T_camera: NDArray[np.float64], settings: GrowthSettings
) -> bool:
    """Whether a camera is far enough from where its last keyframe was taken, or turned far enough, for another."""
    step = float(np.linalg.norm(world_T_camera[:3, 3] - world_T_before[:3, 3]))
    cosine = 0.5 * (float(np.trace(world_T_before[:3, :3].T @ world_T_camera[:3, :3])) - 1.0)
    return step > settings.keyframe_step or cosine < np.cos(np.radians(settings.keyframe_turn))
