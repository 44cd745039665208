"""The cameras: a pyramid on its segment for each, whose colour says whether the camera knew where it was."""

from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import NDArray
from viser import CameraFrustumHandle, SceneApi

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.view.correction import Part
from bodycam_ros.view.scene_nodes import LOST, REGISTERED, SELECTED, UNKNOWN, place, rgb, segment_name, when_clicked

_FIELD_OF_VIEW = np.radians(60.0)
_ASPECT = 4.0 / 3.0
_SIZE_M = 0.05
_LINE_M = 0.005  # the pyramid stands for a camera; the field of view of a real wide angle lens would hide the body
_SHOWN_SIZE_M = 0.08  # of the one with an image in it


class CameraScene:
    """Draws the cameras of a body."""

    def __init__(self, scene: SceneApi, body: BodyModel, on_click: Callable[[Part], None]) -> None:
        self._selected: str | None = None
        self._shown: str | None = None
        self._registered: dict[str, bool | None] = dict.fromkeys(body.mounts)
        self._cameras: dict[str, CameraFrustumHandle] = {}
        for camera, mount in body.mounts.items():
            frustum = scene.add_camera_frustum(
                f"{segment_name(mount.segment)}/camera_{camera}",
                _FIELD_OF_VIEW,
                _ASPECT,
                scale=_SIZE_M,
                thickness=_LINE_M,
                color=rgb(UNKNOWN),
                variant="filled",
                cast_shadow=False,
                receive_shadow=False,
            )
            when_clicked(frustum, partial(on_click, Part("camera", camera)))
            self._cameras[camera] = frustum
        self.remount(body)

    def remount(self, body: BodyModel) -> None:
        """Show the cameras where a body has them."""
        for camera, mount in body.mounts.items():
            place(self._cameras[camera], mount.segment_T_camera)

    def show_registered(self, camera: str, registered: bool | None) -> None:
        """Show whether a camera knows its own pose; None: nobody says."""
        if self._registered[camera] != registered:
            self._registered[camera] = registered
            self._colour(camera)

    def show_image(self, camera: str | None, pixels: NDArray[np.uint8] | None) -> None:
        """Show an image (H, W, 3) in one camera's pyramid, larger than the others; None: no camera, no image."""
        if self._shown is not None and self._shown != camera:
            self._cameras[self._shown].image = None
            self._cameras[self._shown].scale = _SIZE_M
        self._shown = camera
        if camera is not None:
            self._cameras[camera].scale = _SHOWN_SIZE_M
            self._cameras[camera].image = pixels

    def select(self, part: Part | None) -> None:
        """Show which camera is selected."""
        before, self._selected = self._selected, part.name if part is not None and part.kind == "camera" else None
        for camera in (before, self._selected):
            if camera is not None:
                self._colour(camera)

    def show(self, visible: bool) -> None:
        """Show or hide all cameras."""
        for frustum in self._cameras.values():
            frustum.visible = visible

    def _colour(self, camera: str) -> None:
        state = {True: REGISTERED, False: LOST, None: UNKNOWN}[self._registered[camera]]
        self._cameras[camera].color = rgb(SELECTED if camera == self._selected else state)
