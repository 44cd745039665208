"""The body's surface: half transparent around the skeleton, each mesh on its segment."""

from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path

from viser import MeshHandle, SceneApi

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.static_cameras.limb_mesh import capsule_surfaces
from bodycam_ros.static_cameras.surface import Surface
from bodycam_ros.static_cameras.surface_folder import surfaces_of
from bodycam_ros.viewer.scene_nodes import segment_name, segment_rgb

_OPACITY = 0.45

SurfaceReader = Callable[[BodyModel], Mapping[str, Surface]]
"""Segment -> its surface, of a body as it is corrected now."""


class SurfaceScene:
    """Draws the surface of a body; the frames of its segments move it.

    Args:
        scene: that it is added to.
        read: gives the surface of a body.

    It is made while it is visible: a correction changes the body with every move.
    """

    def __init__(self, scene: SceneApi, read: SurfaceReader) -> None:
        self._scene, self._read = scene, read
        self._body: BodyModel | None = None
        self._drawn: BodyModel | None = None
        self._meshes: list[MeshHandle] = []
        self._is_visible = False

    def reshape(self, body: BodyModel) -> None:
        """Show the surface of another body.

        Raises:
            BodyError: it cannot be used.
        """
        self._body = body
        self.show(self._is_visible)

    def show(self, visible: bool) -> None:
        """Show the surface, or hide it; raises as ``reshape``."""
        self._is_visible = visible
        if visible and self._body is not None and self._body is not self._drawn:
            self._draw(self._body)
        for mesh in self._meshes:
            mesh.visible = visible

    def _draw(self, body: BodyModel) -> None:
        surfaces = self._read(body)
        for mesh in self._meshes:
            mesh.remove()
        self._drawn = body
        self._meshes = [
            self._scene.add_mesh_simple(
                f"{segment_name(segment)}/surface",
                surface.vertices,
                surface.faces,
                color=segment_rgb(segment),
                opacity=_OPACITY,
                cast_shadow=False,
                receive_shadow=False,
            )
            for segment, surface in surfaces.items()
        ]


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
