"""The cameras: a pyramid on its segment for each, whose colour says whether the camera knew where it was."""

from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import NDArray
from viser import CameraFrustumHandle, MeshHandle, SceneApi

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.geometry import Array
from bodycam_ros.view.correction import Part
from bodycam_ros.view.scene_nodes import LOST, REGISTERED, SELECTED, UNKNOWN, place, rgb, segment_name, when_clicked

_FIELD_OF_VIEW = np.radians(60.0)
"""Of the pyramids, from top to bottom: that of a wide angle lens would hide the body."""

_ASPECT = 4.0 / 3.0
_DEPTH_M = 0.07
_SHOWN_SCALE = 0.08  # of the one with an image in it, as viser has it: the pyramid is 0.15 m deep
_LINE_M = 0.005


class CameraScene:
    """Draws the cameras of a body."""

    def __init__(self, scene: SceneApi, body: BodyModel, on_click: Callable[[Part], None]) -> None:
        self._scene, self._body, self._on_click = scene, body, on_click
        self._selected: str | None = None
        self._shown: str | None = None
        self._is_visible = True
        self._picture: CameraFrustumHandle | None = None
        self._registered: dict[str, bool | None] = dict.fromkeys(body.mounts)
        self._cameras: dict[str, MeshHandle] = {}
        vertices, faces = _pyramid()
        for camera, mount in body.mounts.items():
            # Not a frustum of viser's: without a graphics card that takes four times as long to draw.
            pyramid = scene.add_mesh_simple(
                f"{segment_name(mount.segment)}/camera_{camera}",
                vertices,
                faces,
                color=rgb(UNKNOWN),
                flat_shading=True,
                cast_shadow=False,
                receive_shadow=False,
            )
            when_clicked(pyramid, partial(on_click, Part("camera", camera)))
            self._cameras[camera] = pyramid
        self.remount(body)

    def remount(self, body: BodyModel) -> None:
        """Show the cameras where a body has them."""
        self._body = body
        for camera, mount in body.mounts.items():
            place(self._cameras[camera], mount.segment_T_camera)
        if self._picture is not None and self._shown is not None:
            place(self._picture, body.mounts[self._shown].segment_T_camera)

    def show_registered(self, camera: str, registered: bool | None) -> None:
        """Show whether a camera knows its own pose; None: nobody says."""
        if self._registered[camera] != registered:
            self._registered[camera] = registered
            self._colour(camera)

    def show_image(self, camera: str | None, pixels: NDArray[np.uint8] | None) -> None:
        """Show an image (H, W, 3) in one camera's pyramid, larger than the others; None: no camera, no image."""
        if camera != self._shown:
            if self._picture is not None:
                self._picture.remove()
                self._picture = None
            self._shown = camera
            self._refresh()
        if camera is None:
            return
        if self._picture is None:
            self._picture = self._add_picture(camera)
        self._picture.image = pixels

    def select(self, part: Part | None) -> None:
        """Show which camera is selected."""
        before, self._selected = self._selected, part.name if part is not None and part.kind == "camera" else None
        for camera in (before, self._selected):
            if camera is not None:
                self._colour(camera)

    def show(self, visible: bool) -> None:
        """Show or hide all cameras."""
        self._is_visible = visible
        self._refresh()

    def _refresh(self) -> None:
        for camera, pyramid in self._cameras.items():
            pyramid.visible = self._is_visible and camera != self._shown
        if self._picture is not None:
            self._picture.visible = self._is_visible

    def _add_picture(self, camera: str) -> CameraFrustumHandle:
        mount = self._body.mounts[camera]
        frustum = self._scene.add_camera_frustum(
            f"{segment_name(mount.segment)}/picture_{camera}",
            _FIELD_OF_VIEW,
            _ASPECT,
            scale=_SHOWN_SCALE,
            thickness=_LINE_M,
            color=self._rgb(camera),
            cast_shadow=False,
            receive_shadow=False,
            visible=self._is_visible,
        )
        when_clicked(frustum, partial(self._on_click, Part("camera", camera)))
        place(frustum, mount.segment_T_camera)
        return frustum

    def _colour(self, camera: str) -> None:
        self._cameras[camera].color = self._rgb(camera)
        if self._picture is not None and camera == self._shown:
            self._picture.color = self._rgb(camera)

    def _rgb(self, camera: str) -> tuple[int, int, int]:
        state = {True: REGISTERED, False: LOST, None: UNKNOWN}[self._registered[camera]]
        return rgb(SELECTED if camera == self._selected else state)


def _pyramid() -> tuple[Array, NDArray[np.int32]]:
    """Vertices (5, 3) [m] and faces (6, 3) of a camera that looks along z, with y down: its tip is the lens."""
    half_height = _DEPTH_M * np.tan(_FIELD_OF_VIEW / 2.0)
    corners = [[x * _ASPECT * half_height, y * half_height, _DEPTH_M] for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    sides = [[0, 1 + (side + 1) % 4, 1 + side] for side in range(4)]
    return np.array([[0.0, 0.0, 0.0], *corners]), np.array([*sides, [1, 2, 3], [1, 3, 4]], np.int32)
