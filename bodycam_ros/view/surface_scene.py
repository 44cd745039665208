"""The body's surface as static cameras look for it: half transparent on the skeleton, each mesh on its segment."""

from collections.abc import Callable, Mapping

from viser import MeshHandle, SceneApi

from bodycam_ros.outside.surface import Surface
from bodycam_ros.view.scene_nodes import segment_name, segment_rgb

_OPACITY = 0.45


class SurfaceScene:
    """Draws the surface of a body once somebody wants to see it; what draws the skeleton moves it.

    Args:
        scene: that it is added to.
        read: gives segment -> its surface; asked at most once if it does.
    """

    def __init__(self, scene: SceneApi, read: Callable[[], Mapping[str, Surface]]) -> None:
        self._scene, self._read = scene, read
        self._surfaces: Mapping[str, Surface] | None = None
        self._meshes: list[MeshHandle] = []

    @property
    def surfaces(self) -> Mapping[str, Surface]:
        """Segment -> its surface.

        Raises:
            BodyError: it cannot be used.
        """
        if self._surfaces is None:
            self._surfaces = self._read()
        return self._surfaces

    def show(self, visible: bool) -> None:
        """Show or hide it.

        Raises:
            BodyError: it cannot be used.
        """
        if visible and not self._meshes:
            self._meshes = [
                self._scene.add_mesh_simple(
                    f"{segment_name(segment)}/surface",
                    surface.vertices,
                    surface.faces,
                    color=segment_rgb(segment),
                    opacity=_OPACITY,
                )
                for segment, surface in self.surfaces.items()
            ]
        for mesh in self._meshes:
            mesh.visible = visible
