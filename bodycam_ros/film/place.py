"""The place of a film: its ground, the points of its map, and surfaces where these are dense."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from bodycam_ros.environment.placement import Route
from bodycam_ros.environment.scenery import Scenery
from bodycam_ros.film.ray_scene import RayScene
from bodycam_ros.geometry import Array
from bodycam_ros.registration.reference_map import ReferenceMap

_DRAWN = 60_000  # points at most
_FARTHEST = 0.995  # quantile of heights and distances: a few points, far away through a window, are not the place
_NEIGHBOURS = 4  # a disc reaches as far as so many neighbours
_LARGEST_M = 0.15  # radius of a disc: where points are farther apart there is no surface
_GROUND_M = 0.06  # discs so near to the ground hide no feet
_CORNERS = 6  # of a disc


@dataclass(frozen=True, eq=False)
class Place:
    """What is around the person.

    Attributes:
        ground_m: height of the ground; None where the map's z does not point up.
        points_world: (N, 3) to draw [m].
        colours: (N, 3) uint8 red, green, blue.
        normals: (N, 3) of the surfaces that points lie on; None of a map without photographs.
        route: an environment in place of the one that was there.
        scenery: meshes of that environment, in the world; they hide what is behind them.
    """

    ground_m: float | None
    points_world: Array
    colours: NDArray[np.uint8]
    normals: Array | None
    route: Route | None = None
    scenery: Scenery | None = None

    @classmethod
    def around(cls, reference_map: ReferenceMap | None, lowest: Array) -> "Place":
        """A place by its map, if there is one.

        Args:
            reference_map: of the place.
            lowest: (F,) height of the lowest point of the person over time [m]: most often on the ground.
        """
        ground_m = float(np.quantile(lowest, 0.25))
        if reference_map is None:
            return cls(ground_m, np.zeros((0, 3)), np.zeros((0, 3), np.uint8), None)
        points = reference_map.points_world
        away = np.linalg.norm(points - np.median(points, axis=0), axis=1)
        rows = np.flatnonzero(away <= np.quantile(away, _FARTHEST))
        rows = rows[:: -(-len(rows) // _DRAWN) or 1]
        normals = None if reference_map.photographs is None else reference_map.photographs.normals[rows]
        upright = ground_m if reference_map.gravity_aligned else None
        return cls(
            upright, points[rows], reference_map.colours[rows], None if normals is None else normals.astype(float)
        )

    @cached_property
    def surface(self) -> RayScene | None:
        """Discs on the points, each as large as to its neighbours, where these are near; None where none are."""
        if self.normals is None or len(self.points_world) <= _NEIGHBOURS:
            return None
        radii = cKDTree(self.points_world).query(self.points_world, k=_NEIGHBOURS + 1)[0][:, -1]
        chosen = (radii < _LARGEST_M) & (np.linalg.norm(self.normals, axis=1) > 0.5)
        if self.ground_m is not None:
            chosen &= np.abs(self.points_world[:, 2] - self.ground_m) > _GROUND_M
        if not chosen.any():
            return None
        return RayScene(*_discs(self.points_world[chosen], self.normals[chosen], radii[chosen]))


def _discs(points: Array, normals: Array, radii: Array) -> tuple[Array, NDArray[np.int32]]:
    """Vertices and triangles of a polygon on each point, perpendicular to its normal."""
    aside = np.eye(3)[np.abs(normals).argmin(axis=1)]
    x = np.cross(normals, aside)
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    y = np.cross(normals, x)
    angles = 2.0 * np.pi * np.arange(_CORNERS) / _CORNERS
    around = np.cos(angles)[:, None] * x[:, None] + np.sin(angles)[:, None] * y[:, None]
    vertices = (points[:, None] + radii[:, None, None] * around).reshape(-1, 3)
    fan = np.array([(0, k, k + 1) for k in range(1, _CORNERS - 1)], np.int32)
    triangles = (_CORNERS * np.arange(len(points), dtype=np.int32)[:, None, None] + fan).reshape(-1, 3)
    return vertices, triangles
