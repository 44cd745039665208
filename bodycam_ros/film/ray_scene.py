"""Triangles that rays are traced against, by Embree: a ray for every pixel is exact through every lens."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.surface import Faces
from bodycam_ros.errors import ViewError

Floats = NDArray[np.float32]

MISSED = -1
"""In place of a triangle, where a ray meets none."""


@dataclass(frozen=True, eq=False)
class Hits:
    """What N rays meet first.

    Attributes:
        triangles: (N,) rows of the scene's triangles; ``MISSED`` where there is none.
        distances: (N,) along the ray, in lengths of its direction; infinite where there is none.
        shares: (N, 3) barycentric coordinates, by which values of the triangle's corners are interpolated.
    """

    triangles: NDArray[np.int32]
    distances: Floats
    shares: Floats

    @property
    def met(self) -> NDArray[np.bool_]:
        """(N,) whether there is a triangle."""
        found: NDArray[np.bool_] = self.triangles != MISSED
        return found


class RayScene:
    """One mesh of vertices (V, 3) [m] and triangles (T, 3).

    Raises:
        ViewError: Embree is not installed.
    """

    def __init__(self, vertices: NDArray[np.floating], triangles: Faces) -> None:
        try:
            from embreex.mesh_construction import TriangleMesh
            from embreex.rtcore_scene import EmbreeScene
        except ImportError as error:
            raise ViewError(
                f"a film needs the ray tracer embreex, which cannot be imported ({error}); install it: "
                "pip install 'bodycam_ros[film]'"
            ) from error
        self._scene = EmbreeScene()
        self._mesh = TriangleMesh(self._scene, _rows(vertices), np.ascontiguousarray(triangles, np.int32))

    def trace(self, origins: NDArray[np.floating], directions: NDArray[np.floating]) -> Hits:
        """What rays from origins (N, 3) [m], or one (3,), along directions (N, 3) meet first."""
        found = self._scene.run(_origins(origins, directions), _rows(directions), output=1)
        triangles = np.asarray(found["primID"], np.int32)
        distances = np.where(triangles == MISSED, np.inf, found["tfar"]).astype(np.float32)
        u, v = found["u"], found["v"]
        return Hits(triangles, distances, np.stack([1.0 - u - v, u, v], axis=1).astype(np.float32))

    def is_free(self, origins: NDArray[np.floating], directions: NDArray[np.floating]) -> NDArray[np.bool_]:
        """(N,) whether rays from origins (N, 3) [m] along directions (N, 3), or one (3,), meet nothing."""
        along = np.broadcast_to(np.asarray(directions, np.float32), np.shape(origins))
        free: NDArray[np.bool_] = np.asarray(self._scene.run(_rows(origins), _rows(along), query="OCCLUDED")) == MISSED
        return free


def free_share(scene: RayScene, points: NDArray[np.floating], directions: NDArray[np.floating]) -> Floats:
    """(N,) share of directions (D, 3) in which points (N, 3) [m] see no triangle: of a light, or of the sky."""
    free = np.zeros(len(points), np.float32)
    for direction in directions:
        free += scene.is_free(points, direction)
    return free / np.float32(len(directions))


def _rows(values: NDArray[np.floating]) -> Floats:
    return np.ascontiguousarray(values, np.float32)


def _origins(origins: NDArray[np.floating], directions: NDArray[np.floating]) -> Floats:
    return _rows(np.broadcast_to(np.asarray(origins, np.float32), np.shape(directions)))
