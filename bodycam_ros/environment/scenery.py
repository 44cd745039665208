"""A place by a file of another program: meshes with colours, as glTF has them."""

import io
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.surface import Faces
from bodycam_ros.errors import ViewError
from bodycam_ros.files.yaml_file import read_bytes
from bodycam_ros.geometry import Array, transform_points
from bodycam_ros.results.colours import GAMMA

SUFFIX = ".glb"
_MOST_BYTES = 200_000_000

Floats = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Scenery:
    """Meshes that do not move.

    Attributes:
        vertices: (V, 3) in the world [m].
        triangles: (T, 3) rows of them.
        colours: (T, 3) red, green and blue, linear in light, 0 to 1.
        content: of the file that they were read from.
    """

    vertices: Array
    triangles: Faces
    colours: Floats
    content: bytes = b""

    def placed(self, world_T_scene: Array) -> "Scenery":
        """The same at another pose (4, 4) [m]."""
        return Scenery(transform_points(world_T_scene, self.vertices), self.triangles, self.colours, self.content)


def read_scenery(path: Path) -> Scenery:
    """Read the meshes of a glTF binary file; its y, which is up there, becomes z, and x stays.

    Raises:
        ViewError: it cannot be read, or has no triangles.
    """
    import trimesh

    content = read_bytes(path, "place, a glTF binary", ViewError, _MOST_BYTES)
    try:
        scene = trimesh.load_scene(io.BytesIO(content), file_type="glb")
        meshes = [mesh for mesh in scene.dump() if isinstance(mesh, trimesh.Trimesh) and len(mesh.faces)]
        colours = [_face_colours(mesh) for mesh in meshes]
    except Exception as error:  # trimesh raises what its parsers raise
        raise ViewError(f"{path}: cannot be read as glTF binary: {error}") from error
    if not meshes:
        raise ViewError(f"{path}: has no triangles; expected meshes of a place")
    before = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    vertices = np.concatenate([np.asarray(mesh.vertices, np.float64) for mesh in meshes])
    faces = np.concatenate([np.asarray(mesh.faces) + row for mesh, row in zip(meshes, before, strict=False)])
    if not np.isfinite(vertices).all():
        raise ViewError(f"{path}: has places that are not finite numbers")
    upright = np.stack([vertices[:, 0], -vertices[:, 2], vertices[:, 1]], axis=1)
    return Scenery(upright, faces.astype(np.int32), np.concatenate(colours), content)


def _face_colours(mesh: Any) -> Floats:
    """(F, 3) linear in light, by the colours of vertices, the material or its texture."""
    if hasattr(mesh.visual, "to_color"):
        visual = mesh.visual.to_color()
        if np.shape(visual.vertex_colors) == (len(mesh.vertices), 4):
            colours = np.asarray(visual.vertex_colors)[mesh.faces].mean(axis=1)
        else:
            colours = np.broadcast_to(mesh.visual.material.main_color, (len(mesh.faces), 4))
    else:
        colours = np.asarray(mesh.visual.face_colors)
    light: Floats = ((colours[:, :3] / 255.0) ** GAMMA).astype(np.float32)
    return light
