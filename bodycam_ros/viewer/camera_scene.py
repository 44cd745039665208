"""The cameras in the scene: a frustum for each; its colour shows whether the camera was registered."""

from collections.abc import Callable, Mapping
from functools import partial

import numpy as np
from numpy.typing import NDArray
from viser import CameraFrustumHandle, LabelHandle, SceneApi

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.picture_style import rgb
from bodycam_ros.static_cameras.station import Station
from bodycam_ros.viewer.correction import Part
from bodycam_ros.viewer.scene_nodes import (
    LOST,
    REGISTERED,
    SELECTED,
    UNKNOWN,
    WORLD,
    add_label,
    place,
    segment_name,
    when_clicked,
)

_FIELD_OF_VIEW = np.radians(60.0)
"""Of a body camera's frustum, from top to bottom: that of a wide angle lens would hide the body."""

_ASPECT = 4.0 / 3.0
_SCALE, _PICTURE_SCALE, _STATIC_SCALE = 0.04, 0.08, 0.25  # of a frustum; a body camera's with an image in it is larger
_LINE_M = 0.006
_NAME_M = 0.03  # of a name along the optical axis: at the tip of the frustum a joint's name may be


class CameraScene:
    """Draws the cameras of a body, and static cameras.

    Attributes:
        nodes: one per camera, with its name beneath.
        names: labels of the body's cameras.
    """

    def __init__(
        self,
        scene: SceneApi,
        body: BodyModel,
        on_click: Callable[[Part], None],
        stations: Mapping[str, Station],
    ) -> None:
        self._selected: Part | None = None
        self._registered: dict[str, bool | None] = dict.fromkeys(body.mounts)
        self._frustums: dict[str, CameraFrustumHandle] = {}
        self.names: list[LabelHandle] = []
        for camera, mount in body.mounts.items():
            name = f"{segment_name(mount.segment)}/camera_{camera}"
            frustum = _add_frustum(scene, name, _FIELD_OF_VIEW, _ASPECT, _SCALE)
            when_clicked(frustum, partial(on_click, Part("camera", camera)))
            self._frustums[camera] = frustum
            self.names.append(add_label(scene, f"{name}/name", camera))
            self.names[-1].position = (0.0, 0.0, _NAME_M)
        for name, station in stations.items():
            lens = station.camera
            field_of_view = 2.0 * float(np.arctan2(lens.height / 2.0, lens.fy))
            aspect = lens.width / lens.height
            frustum = _add_frustum(scene, f"{WORLD}/stations/{name}", field_of_view, aspect, _STATIC_SCALE)
            place(frustum, station.world_T_camera)
            self._frustums[name] = frustum
        self.nodes = [*self._frustums.values()]
        self.reshape(body)

    def reshape(self, body: BodyModel) -> None:
        """Show the cameras where a body has them."""
        for camera, mount in body.mounts.items():
            place(self._frustums[camera], mount.segment_T_camera)

    def show_registered(self, camera: str, registered: bool | None) -> None:
        """Show whether a camera is registered; None: unknown."""
        if self._registered[camera] != registered:
            self._registered[camera] = registered
            self._colour(camera)

    def show_image(self, camera: str | None, pixels: NDArray[np.uint8] | None) -> None:
        """Show an image (H, W, 3) in one camera's frustum, larger than the others; None: no camera, no image."""
        for name, frustum in self._frustums.items():
            image = pixels if name == camera else None
            if image is not None or frustum.image is not None:
                frustum.image = image
            if name in self._registered:
                frustum.scale = _PICTURE_SCALE if name == camera else _SCALE

    def select(self, part: Part | None) -> None:
        """Show which camera is selected."""
        self._selected = part
        for camera in self._registered:
            self._colour(camera)

    def _colour(self, camera: str) -> None:
        state = {True: REGISTERED, False: LOST, None: UNKNOWN}[self._registered[camera]]
        self._frustums[camera].color = rgb(SELECTED if self._selected == Part("camera", camera) else state)


def _add_frustum(scene: SceneApi, name: str, field_of_view: float, aspect: float, scale: float) -> CameraFrustumHandle:
    return scene.add_camera_frustum(
        name,
        field_of_view,
        aspect,
        scale=scale,
        thickness=_LINE_M,
        color=rgb(UNKNOWN),
        variant="filled",
        cast_shadow=False,
        receive_shadow=False,
    )
