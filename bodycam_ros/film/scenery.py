"""A place by a file of another program: meshes with colours, as glTF has them."""

import io
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from bodycam_ros.body.surface import Faces
from bodycam_ros.errors import ViewError
from bodycam_ros.files.yaml_file import read_bytes
from bodycam_ros.film.character import GAMMA
from bodycam_ros.film.lighting import sun_directions
from bodycam_ros.film.ray_scene import Floats, RayScene, free_share
from bodycam_ros.geometry import Array, transform_points

SUFFIX = ".glb"
_MOST_BYTES = 200_000_000
_SUN, _SKY = 0.75, 0.4
_OFF_M = 0.01  # rays to the sun begin so far from the surface
_SUN_RAYS = 8


@dataclass(frozen=True, eq=False)
class Scenery:
    """Meshes that do not move.

    Attributes:
        vertices: (V, 3) in the world [m].
        triangles: (T, 3) rows of them.
        colours: (T, 3) red, green and blue, linear in light, 0 to 1.
    """

    vertices: Array
    triangles: Faces
    colours: Floats

    @cached_property
    def rays(self) -> RayScene:
        """What rays are traced against."""
        return RayScene(self.vertices, self.triangles)

    @cached_property
    def _normals(self) -> Floats:
        a, b, c = (self.vertices[self.triangles[:, corner]] for corner in range(3))
        across = np.cross(b - a, c - a)
        normals: Floats = (across / np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-12)).astype(np.float32)
        return normals

    def placed(self, world_T_scene: Array) -> "Scenery":
        """The same at another pose (4, 4) [m]."""
        return Scenery(transform_points(world_T_scene, self.vertices), self.triangles, self.colours)

    def shade(self, origin: Array, directions: Floats, person: RayScene) -> tuple[Floats, Floats, Floats]:
        """Light (N, 3) along rays (N, 3) from a point (3,), whether each meets a mesh (N,), and how far (N,) [m].

        A person throws a shadow, and so do the meshes.
        """
        hits = self.rays.trace(origin, directions)
        rows = np.flatnonzero(hits.met)
        colours, far = np.zeros((len(directions), 3), np.float32), np.full(len(directions), 1e3, np.float32)
        toward = directions[rows]
        normals = self._normals[hits.triangles[rows]]
        normals = np.where((normals * toward).sum(axis=1, keepdims=True) > 0.0, -normals, normals)
        suns = sun_directions(_SUN_RAYS)
        points = origin + hits.distances[rows, None] * toward + _OFF_M * normals
        facing = np.maximum(normals @ suns.mean(axis=0).astype(np.float32), 0.0)
        free = np.zeros(len(rows), np.float32)
        lit = np.flatnonzero(facing > 0.0)
        free[lit] = np.minimum(free_share(person, points[lit], suns), free_share(self.rays, points[lit], suns))
        light = _SUN * facing * free + _SKY * (0.75 + 0.25 * normals[:, 2])
        colours[rows] = self.colours[hits.triangles[rows]] * light[:, None]
        far[rows] = hits.distances[rows]
        return colours, hits.met.astype(np.float32), far


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
    return Scenery(upright, faces.astype(np.int32), np.concatenate(colours))


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
