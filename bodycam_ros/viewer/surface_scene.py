"""The body's surface: half transparent around the skeleton, each mesh on its segment, with a head and hands."""

from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path

import numpy as np
from viser import LabelHandle, MeshHandle, SceneApi

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.geometry import Array, transform_points
from bodycam_ros.static_cameras.limb_mesh import capsule_surfaces
from bodycam_ros.static_cameras.person_model import with_hands
from bodycam_ros.static_cameras.surface import Surface
from bodycam_ros.static_cameras.surface_folder import surfaces_of
from bodycam_ros.viewer.footage import Detail
from bodycam_ros.viewer.scene_nodes import segment_name, segment_rgb

_OPACITY = 0.45

SurfaceReader = Callable[[BodyModel], Mapping[str, Surface]]
"""Segment -> its surface, of a body as it is corrected now."""


class SurfaceScene:
    """Draws the surface of a body once somebody wants to see it; what draws the skeleton moves it.

    Args:
        scene: that it is added to.
        read: gives the surface of a body; asked once for each body that is shown.
        detail: how finely it is drawn.
    """

    def __init__(self, scene: SceneApi, read: SurfaceReader, detail: Detail) -> None:
        self._scene, self._read, self._detail = scene, read, detail
        self._surfaces: Mapping[str, Surface] | None = None
        self._of: BodyModel | None = None
        self._meshes: list[MeshHandle] = []
        self._is_old = True

    def surfaces(self, body: BodyModel) -> Mapping[str, Surface]:
        """Segment -> its surface.

        Raises:
            BodyError: it cannot be used.
        """
        if self._surfaces is None or self._of is not body:
            self._surfaces, self._of, self._is_old = self._read(body), body, True
        return self._surfaces

    def show(self, body: BodyModel, visible: bool) -> None:
        """Show the surface of a body, or hide it.

        Raises:
            BodyError: it cannot be used.
        """
        if visible:
            self._refresh(body)
        for mesh in self._meshes:
            mesh.visible = visible

    def _refresh(self, body: BodyModel) -> None:
        surfaces = self.surfaces(body)
        if not self._is_old:
            return
        for mesh in self._meshes:
            mesh.remove()
        shown = [
            *(("surface", segment, surface) for segment, surface in surfaces.items()),
            *(("hand", forearm, hand) for forearm, hand in hands_beyond(body, surfaces)),
        ]
        self._meshes = [
            self._scene.add_mesh_simple(
                f"{segment_name(segment)}/{name}",
                *self._detail.mesh(surface.vertices, surface.faces),
                color=segment_rgb(segment),
                opacity=_OPACITY,
                cast_shadow=False,
                receive_shadow=False,
            )
            for name, segment, surface in shown
        ]
        self._is_old = False


def surface_reader(body: BodyModel, body_path: Path, folder: Path | None) -> SurfaceReader:
    """Gives the surface of a body: capsules follow its correction; a scan is as it is, and read once.

    Args:
        body: as it was read.
        body_path: its file.
        folder: of meshes, as the user asks for.
    """
    if folder is None and body.surface is None:
        return capsule_surfaces
    scan = cache(lambda: surfaces_of(body, body_path, folder))
    return lambda corrected: scan()


def surface_points(surfaces: Mapping[str, Surface], body: BodyModel, world_T_segment: Array) -> Array:
    """(N, 3) vertices of a body's surface at poses (S, 4, 4) [m]."""
    poses = dict(zip(body.segments, world_T_segment, strict=True))
    points = [transform_points(poses[segment], surface.vertices) for segment, surface in surfaces.items()]
    return np.concatenate(points) if points else np.zeros((0, 3))


def hands_beyond(body: BodyModel, surfaces: Mapping[str, Surface]) -> list[tuple[str, Surface]]:
    """Forearm, and a stretched hand in its frame, where nobody followed one: a body without looks cut off."""
    whole = with_hands(body)
    wrists = [joint for joint in whole.joints if joint.child not in body.segments and joint.parent in surfaces]
    of_whole = capsule_surfaces(whole) if wrists else {}
    hands = []
    for wrist in wrists:
        hand = of_whole[wrist.child]
        hands.append(
            (wrist.parent, Surface(wrist.child, transform_points(wrist.parent_T_joint, hand.vertices), hand.faces))
        )
    return hands


_SCALE = 0.7
_ASIDE_M = 0.03


class NameScene:
    """Draws names; they move with the segments that joints and cameras are on."""

    def __init__(self, scene: SceneApi, body: BodyModel) -> None:
        self._is_shown, self._shows_cameras = False, True
        self._joints = {
            joint.name: _label(scene, f"{segment_name(joint.parent)}/name_{joint.name}", joint.name)
            for joint in body.joints
        }
        self._cameras = {
            camera: _label(scene, f"{segment_name(mount.segment)}/camera_name_{camera}", camera)
            for camera, mount in body.mounts.items()
        }
        self.reshape(body)

    def reshape(self, body: BodyModel) -> None:
        """Put the names where a body has its joints and cameras."""
        for joint in body.joints:
            self._joints[joint.name].position = joint.parent_T_joint[:3, 3]
        for camera, mount in body.mounts.items():
            # In the pyramid, not at its tip, where a joint's name may be.
            self._cameras[camera].position = mount.segment_T_camera[:3, 3] + _ASIDE_M * mount.segment_T_camera[:3, 2]

    def show(self, visible: bool) -> None:
        """Show or hide all names."""
        self._is_shown = visible
        self._refresh()

    def show_cameras(self, visible: bool) -> None:
        """Say whether cameras are shown: hidden ones have no names."""
        self._shows_cameras = visible
        self._refresh()

    def _refresh(self) -> None:
        for label in self._joints.values():
            label.visible = self._is_shown
        for label in self._cameras.values():
            label.visible = self._is_shown and self._shows_cameras


def _label(scene: SceneApi, name: str, text: str) -> LabelHandle:
    words = text.replace("_", " ")
    return scene.add_label(name, words, visible=False, font_screen_scale=_SCALE, anchor="center-left")
