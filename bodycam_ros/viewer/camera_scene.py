"""The cameras in the scene: a pyramid for each; its colour tells whether the camera was registered."""

from collections.abc import Callable, Mapping
from functools import partial

import numpy as np
from numpy.typing import NDArray
from viser import CameraFrustumHandle, FrameHandle, LabelHandle, MeshHandle, SceneApi

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.geometry import Array
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
"""Of the pyramids, from top to bottom: that of a wide angle lens would hide the body."""

_ASPECT = 4.0 / 3.0
_DEPTH_M = 0.07
_PICTURE_SCALE, _PICTURE_LINE_M = 0.08, 0.005  # of the one with an image in it: the pyramid is 0.15 m deep
_NAME_M = 0.03  # of a name along the optical axis: at the tip of the pyramid a joint's name may be
_STATIC_SCALE, _STATIC_LINE_M = 0.25, 0.008


class CameraScene:
    """Draws the cameras of a body, and static cameras.

    Attributes:
        nodes: one per camera, with all that is drawn of it beneath.
        names: labels of the body's cameras.
    """

    def __init__(
        self,
        scene: SceneApi,
        body: BodyModel,
        on_click: Callable[[Part], None],
        stations: Mapping[str, Station],
    ) -> None:
        self._scene, self._on_click = scene, on_click
        self._selected: Part | None = None
        self._pictured: str | None = None
        self._picture: CameraFrustumHandle | None = None
        self._registered: dict[str, bool | None] = dict.fromkeys(body.mounts)
        self._frames: dict[str, FrameHandle] = {}
        self._pyramids: dict[str, MeshHandle] = {}
        self.names: list[LabelHandle] = []
        vertices, faces = _pyramid()
        for camera, mount in body.mounts.items():
            name = f"{segment_name(mount.segment)}/camera_{camera}"
            self._frames[camera] = scene.add_frame(name, show_axes=False)
            # Not a frustum of viser's: without a graphics card that takes four times as long to draw.
            self._pyramids[camera] = scene.add_mesh_simple(
                f"{name}/pyramid",
                vertices,
                faces,
                color=rgb(UNKNOWN),
                flat_shading=True,
                cast_shadow=False,
                receive_shadow=False,
            )
            when_clicked(self._pyramids[camera], partial(on_click, Part("camera", camera)))
            self.names.append(add_label(scene, f"{name}/name", camera))
            self.names[-1].position = (0.0, 0.0, _NAME_M)
        self._static = {name: _add_static(scene, station) for name, station in stations.items()}
        self.nodes = [*self._frames.values(), *self._static.values()]
        self.reshape(body)

    def reshape(self, body: BodyModel) -> None:
        """Show the cameras where a body has them."""
        for camera, mount in body.mounts.items():
            place(self._frames[camera], mount.segment_T_camera)

    def show_registered(self, camera: str, registered: bool | None) -> None:
        """Show whether a camera is registered; None: unknown."""
        if self._registered[camera] != registered:
            self._registered[camera] = registered
            self._colour(camera)

    def show_image(self, camera: str | None, pixels: NDArray[np.uint8] | None) -> None:
        """Show an image (H, W, 3) in one camera's pyramid, larger than the others; None: no camera, no image."""
        for name, static in self._static.items():
            static.image = pixels if name == camera else None
        camera = camera if camera in self._frames else None
        if camera != self._pictured:
            if self._picture is not None:
                self._picture.remove()
            for name, pyramid in self._pyramids.items():
                pyramid.visible = name != camera
            self._pictured, self._picture = camera, None if camera is None else self._add_picture(camera)
        if self._picture is not None:
            self._picture.image = pixels

    def select(self, part: Part | None) -> None:
        """Show which camera is selected."""
        self._selected = part
        for camera in self._pyramids:
            self._colour(camera)

    def _add_picture(self, camera: str) -> CameraFrustumHandle:
        frustum = self._scene.add_camera_frustum(
            f"{self._frames[camera].name}/picture",
            _FIELD_OF_VIEW,
            _ASPECT,
            scale=_PICTURE_SCALE,
            thickness=_PICTURE_LINE_M,
            color=self._pyramids[camera].color,
            cast_shadow=False,
            receive_shadow=False,
        )
        when_clicked(frustum, partial(self._on_click, Part("camera", camera)))
        return frustum

    def _colour(self, camera: str) -> None:
        state = {True: REGISTERED, False: LOST, None: UNKNOWN}[self._registered[camera]]
        colour = rgb(SELECTED if self._selected == Part("camera", camera) else state)
        self._pyramids[camera].color = colour
        if self._picture is not None and camera == self._pictured:
            self._picture.color = colour


def _pyramid() -> tuple[Array, NDArray[np.int32]]:
    """Vertices (5, 3) [m] and faces (6, 3) of a camera that looks along z, with y down: its tip is the lens."""
    half_height = _DEPTH_M * np.tan(_FIELD_OF_VIEW / 2.0)
    corners = [[x * _ASPECT * half_height, y * half_height, _DEPTH_M] for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    sides = [[0, 1 + (side + 1) % 4, 1 + side] for side in range(4)]
    return np.array([[0.0, 0.0, 0.0], *corners]), np.array([*sides, [1, 2, 3], [1, 3, 4]], np.int32)


def _add_static(scene: SceneApi, station: Station) -> CameraFrustumHandle:
    camera = station.camera
    frustum = scene.add_camera_frustum(
        f"{WORLD}/stations/{station.name}",
        2.0 * float(np.arctan2(camera.height / 2.0, camera.fy)),
        camera.width / camera.height,
        scale=_STATIC_SCALE,
        thickness=_STATIC_LINE_M,
        color=rgb(UNKNOWN),
    )
    place(frustum, station.world_T_camera)
    return frustum
