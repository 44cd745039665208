"""The landmarks that the chosen camera sees at the instant shown, brighter than those of the map."""

import numpy as np
from viser import PointCloudHandle, SceneApi

from bodycam_ros.drawing.overlay import GOOD
from bodycam_ros.geometry import Array
from bodycam_ros.view.scene_nodes import WORLD, rgb

_POINT_M = 0.045


class SeenScene:
    """Draws landmarks."""

    def __init__(self, scene: SceneApi) -> None:
        self._scene = scene
        self._points: PointCloudHandle | None = None

    def show(self, points_world: Array | None) -> None:
        """Show points (N, 3) [m] in place of those before, or none."""
        if points_world is None or not len(points_world):
            if self._points is not None:
                self._points.visible = False
            return
        if self._points is None:
            self._points = self._scene.add_point_cloud(
                f"{WORLD}/seen", points_world, rgb(GOOD), point_size=_POINT_M, point_shape="circle",
                point_shading="flat", precision="float32",
            )  # fmt: skip
        self._points.points = points_world.astype(np.float32)
        self._points.visible = True
