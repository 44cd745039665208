"""The body's surface: half transparent around the skeleton, each mesh on its segment."""

from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path

import numpy as np
from viser import MeshHandle, SceneApi

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.geometry import Array, transform_points
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
        self._surfaces: Mapping[str, Surface] | None = None
        self._drawn: Mapping[str, Surface] | None = None
        self._meshes: list[MeshHandle] = []
        self._is_visible = False

    def reshape(self, body: BodyModel) -> None:
        """Show the surface of another body.

        Raises:
            BodyError: it cannot be used.
        """
        if body is not self._body:
            self._body, self._surfaces = body, None
        if self._is_visible:
            self._draw()

    @property
    def surfaces(self) -> Mapping[str, Surface]:
        """Segment -> surface of the body.

        Raises:
            BodyError: it cannot be used.
        """
        if self._surfaces is None:
            self._surfaces = {} if self._body is None else self._read(self._body)
        return self._surfaces

    def show(self, visible: bool) -> None:
        """Show the surface, or hide it; raises as ``surfaces``."""
        self._is_visible = visible
        if visible and self._body is not None:
            self._draw()
        for mesh in self._meshes:
            mesh.visible = visible

    def _draw(self) -> None:
        surfaces = self.surfaces
        if surfaces is self._drawn:
            return
        self._drawn = surfaces
        for mesh in self._meshes:
            mesh.remove()
        self._meshes = [
            self._scene.add_mesh_simple(
                f"{segment_name(segment)}/surface",
                surface.vertices,
                surface.faces,
                color=segment_rgb(segment),
                opacity=_OPACITY,
                cast_shadow=False,
                receive_shadow=False,
                visible=self._is_visible,
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


def surface_points(surfaces: Mapping[str, Surface], body: BodyModel, world_T_segment: Array) -> Array:
    """(N, 3) vertices of a body's surface at poses (S, 4, 4) [m]."""
    poses = dict(zip(body.segments, world_T_segment, strict=True))
    points = [transform_points(poses[segment], surface.vertices) for segment, surface in surfaces.items()]
    return np.concatenate(points) if points else np.zeros((0, 3))
