"""Static cameras in the scene: a pyramid where each stands, as wide as its lens, with the image of the chosen one."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from viser import CameraFrustumHandle, SceneApi

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.geometry import Array
from bodycam_ros.outside.body_surface import BodySurface
from bodycam_ros.outside.region_settings import RegionSettings
from bodycam_ros.outside.region_tracker import RegionTracker
from bodycam_ros.outside.station import Station
from bodycam_ros.outside.surface import Surface
from bodycam_ros.view.scene_nodes import UNKNOWN, WORLD, place, rgb

_SIZE_M = 0.25
_LINE_M = 0.008


class StationScene:
    """Draws stations, and knows where they should see the contour of a body.

    Attributes:
        stations: by name.
    """

    def __init__(self, scene: SceneApi, stations: Mapping[str, Station]) -> None:
        self.stations = stations
        self._tracker: RegionTracker | None = None
        self._surfaces: Mapping[str, Surface] | None = None
        self._cameras: dict[str, CameraFrustumHandle] = {}
        for name, station in stations.items():
            camera = station.camera
            self._cameras[name] = scene.add_camera_frustum(
                f"{WORLD}/stations/{name}",
                2.0 * float(np.arctan2(camera.height / 2.0, camera.fy)),
                camera.width / camera.height,
                scale=_SIZE_M,
                thickness=_LINE_M,
                color=rgb(UNKNOWN),
            )
            place(self._cameras[name], station.world_T_camera)

    def contour(self, station: str, body: BodyModel, surfaces: Mapping[str, Surface], world_T_segment: Array) -> Array:
        """Pixels (N, 2) of the visible contour of a body at poses (S, 4, 4).

        Raises:
            BodyError: the surfaces are none of this body.
        """
        if self._tracker is None or self._surfaces is not surfaces:
            self._surfaces = surfaces
            self._tracker = RegionTracker(body, BodySurface.of(body, surfaces), self.stations, RegionSettings())
        pixels: Array = self._tracker.views[station].contour(world_T_segment).points[:, :2]
        return pixels

    def show_image(self, station: str | None, pixels: NDArray[np.uint8] | None) -> None:
        """Show an image (H, W, 3) in one station's pyramid, and none in the others."""
        for name, camera in self._cameras.items():
            camera.image = pixels if name == station else None

    def show(self, visible: bool) -> None:
        """Show or hide them all."""
        for camera in self._cameras.values():
            camera.visible = visible
