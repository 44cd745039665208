"""Light on the person and on the ground: a sun with soft edges, and the sky as far as nothing hides it."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.surface import vertex_normals
from bodycam_ros.film.character import PALETTE, PosedMesh
from bodycam_ros.film.ray_scene import Floats, RayScene, free_share

_SUN_FROM = np.array([0.35, 0.55, 1.0])
_SUN_RADIUS = np.radians(3.0)  # larger than the real one: soft shadows
_SUN_RAYS, _SKY_RAYS = 12, 32
_OFF_M = 0.006  # rays begin so far from the surface that they come from
_SUN, _SKY, _FROM_GROUND = 1.05, 0.62, 0.22  # brightness of each
_CELL_M = 0.02  # of the shadow on the ground
_AROUND_M = 0.6  # of the shadow: as far as feet darken the ground around them
_HIDDEN_SUN, _HIDDEN_SKY = 0.42, 0.30  # how much darker the ground is without each
_SUN_BLUR, _SKY_BLUR = 1.0, 2.5  # of both, in cells: few rays leave edges


@dataclass(frozen=True, eq=False)
class LitMesh:
    """A mesh with what its vertices receive.

    Attributes:
        mesh: of one time.
        normals: (V, 3) unit.
        sun: (V,) share of the sun that is not hidden, 0 to 1.
        sky: (V,) light from all other directions.
    """

    mesh: PosedMesh
    normals: Floats
    sun: Floats
    sky: Floats

    def moved(self, mesh: PosedMesh) -> "LitMesh":
        """The same light on the mesh of a time so near that shadows are the same."""
        return LitMesh(mesh, vertex_normals(mesh.vertices, mesh.triangles), self.sun, self.sky)

    def colours(self, triangles: NDArray[np.int32], shares: Floats, directions: Floats) -> Floats:
        """(N, 3) light, linear, that points on triangles (N,) with shares (N, 3) send against rays (N, 3)."""
        corners = self.mesh.triangles[triangles]
        weights = shares[..., None]
        normals = (self.normals[corners] * weights).sum(axis=1)
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), np.float32(1e-6))
        albedo = PALETTE[(self.mesh.shares[corners] * weights).sum(axis=1).argmax(axis=1)]
        sun, sky = (self.sun[corners] * shares).sum(axis=1), (self.sky[corners] * shares).sum(axis=1)
        toward = SUN.astype(np.float32)
        direct = sun * np.maximum(normals @ toward, 0.0)
        half = toward - directions / np.linalg.norm(directions, axis=1, keepdims=True)
        half /= np.linalg.norm(half, axis=1, keepdims=True)
        gloss = sun * np.maximum((normals * half).sum(axis=1), 0.0) ** 24
        lit: Floats = (albedo * (_SUN * direct + sky)[:, None] + 0.05 * gloss[:, None]).astype(np.float32)
        return lit


SUN = _SUN_FROM / np.linalg.norm(_SUN_FROM)
"""(3,) unit vector to the sun, in a world whose z points up."""


def lit_mesh(mesh: PosedMesh, scene: RayScene) -> LitMesh:
    """Light on each vertex of a mesh, by rays in its own scene."""
    normals = np.asarray(vertex_normals(mesh.vertices, mesh.triangles), np.float32)
    origins = mesh.vertices + np.float32(_OFF_M) * normals
    sun = free_share(scene, origins, sun_directions())
    received, most = np.zeros(len(normals), np.float32), np.zeros(len(normals), np.float32)
    for direction in _sky_directions().astype(np.float32):
        facing = normals @ direction
        rows = np.flatnonzero(facing > 0.02)
        most[rows] += facing[rows]
        received[rows] += facing[rows] * scene.is_free(origins[rows], direction)
    up = 0.5 * (1.0 + normals[:, 2])
    sky = received / np.maximum(most, np.float32(1e-3))
    light = _SKY * up * sky + _FROM_GROUND * (1.0 - up) * (0.4 + 0.6 * sky)
    return LitMesh(mesh, normals, sun, light.astype(np.float32))


@dataclass(frozen=True, eq=False)
class GroundShadow:
    """How bright the ground is, on a grid of points of the world; outside it 1.

    Attributes:
        low: (2,) of its first point [m].
        light: (Y, X) 0 to 1.
    """

    low: NDArray[np.float64]
    light: Floats

    def at(self, x: Floats, y: Floats) -> Floats:
        """Brightness (H, W) at places (H, W) of the ground [m]."""
        columns = ((x - self.low[0]) / _CELL_M).astype(np.float32)
        rows = ((y - self.low[1]) / _CELL_M).astype(np.float32)
        kind = {"interpolation": cv2.INTER_LINEAR, "borderMode": cv2.BORDER_CONSTANT, "borderValue": 1.0}
        return np.asarray(cv2.remap(self.light, columns, rows, **kind), np.float32)


def ground_shadow(mesh: PosedMesh, scene: RayScene, ground_m: float) -> GroundShadow:
    """The shadow of a mesh on a level ground at a height [m]."""
    heights = np.maximum(mesh.vertices[:, 2] - ground_m, 0.0)
    fallen = mesh.vertices[:, :2] - heights[:, None] * (SUN[:2] / SUN[2])
    both = np.concatenate([mesh.vertices[:, :2], fallen])
    low, high = both.min(axis=0) - _AROUND_M, both.max(axis=0) + _AROUND_M
    low = np.floor(low / _CELL_M) * _CELL_M  # the same points in every picture: nothing flickers
    columns, rows = np.ceil((high - low) / _CELL_M).astype(int) + 1
    x, y = np.meshgrid(low[0] + _CELL_M * np.arange(columns), low[1] + _CELL_M * np.arange(rows))
    points = np.stack([x.ravel(), y.ravel(), np.full(x.size, ground_m + 0.002)], axis=1)
    sun, sky = free_share(scene, points, sun_directions()), free_share(scene, points, _sky_directions())
    hidden = _HIDDEN_SUN * _blurred(1.0 - sun, x.shape, _SUN_BLUR) + _HIDDEN_SKY * _blurred(
        1.0 - sky, x.shape, _SKY_BLUR
    )
    # It ends at one: an edge of the grid is not to be seen.
    edge = np.minimum.outer(_ramp(int(rows)), _ramp(int(columns)))
    return GroundShadow(low, np.asarray(1.0 - hidden * edge, np.float32))


def _blurred(share: Floats, shape: tuple[int, ...], cells: float) -> Floats:
    return np.asarray(cv2.GaussianBlur(share.reshape(shape), (0, 0), cells), np.float32)


def _ramp(count: int) -> Floats:
    """(count,) from 0 at both ends to 1 within half of what surrounds a shadow."""
    from_end = np.minimum(np.arange(count), np.arange(count)[::-1])
    ramp: Floats = np.clip(from_end * _CELL_M / (0.5 * _AROUND_M), 0.0, 1.0).astype(np.float32)
    return ramp


def sun_directions(count: int = _SUN_RAYS) -> NDArray[np.float64]:
    """(count, 3) directions to points of the sun, evenly over it."""
    aside = np.cross(SUN, [0.0, 0.0, 1.0])
    aside /= np.linalg.norm(aside)
    across = np.cross(SUN, aside)
    radii, angles = _SUN_RADIUS * np.sqrt((np.arange(count) + 0.5) / count), _turns(count)
    offsets = radii[:, None] * (np.cos(angles)[:, None] * aside + np.sin(angles)[:, None] * across)
    directions: NDArray[np.float64] = SUN + offsets
    return directions


def _sky_directions() -> NDArray[np.float64]:
    """Directions evenly over the upper half, as many near the horizon as their share of light."""
    height = np.sqrt((np.arange(_SKY_RAYS) + 0.5) / _SKY_RAYS)
    angles = _turns(_SKY_RAYS)
    level = np.sqrt(1.0 - height**2)
    return np.stack([level * np.cos(angles), level * np.sin(angles), height], axis=1)


def _turns(count: int) -> NDArray[np.float64]:
    """The golden angle and its multiples: even on a disc (Vogel 1979)."""
    turns: NDArray[np.float64] = np.pi * (3.0 - np.sqrt(5.0)) * np.arange(count)
    return turns
