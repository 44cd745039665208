"""A place of another program in the light of the sun and the sky, by rays."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from bodycam_ros.body.surface import face_normals
from bodycam_ros.environment.scenery import Scenery
from bodycam_ros.film.lighting import sun_directions
from bodycam_ros.film.ray_scene import Floats, RayScene, free_share
from bodycam_ros.geometry import Array

_SUN, _SKY = 0.75, 0.4
_OFF_M = 0.01  # rays to the sun begin so far from the surface
_SUN_RAYS = 8


@dataclass(frozen=True, eq=False)
class LitScenery:
    """Meshes that rays are traced against.

    Attributes:
        scenery: in the world.
    """

    scenery: Scenery

    @cached_property
    def rays(self) -> RayScene:
        """What rays are traced against."""
        return RayScene(self.scenery.vertices, self.scenery.triangles)

    @cached_property
    def _normals(self) -> Floats:
        across = face_normals(self.scenery.vertices, self.scenery.triangles)
        normals: Floats = (across / np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-12)).astype(np.float32)
        return normals

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
        colours[rows] = self.scenery.colours[hits.triangles[rows]] * light[:, None]
        far[rows] = hits.distances[rows]
        return colours, hits.met.astype(np.float32), far
