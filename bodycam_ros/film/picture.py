"""One picture of a film: ground and sky or a recorded image, the shadow, the points of the map, and the person."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.film.character import PosedMesh
from bodycam_ros.film.ground import ground_colours
from bodycam_ros.film.lighting import GroundShadow, LitMesh, ground_shadow, lit_mesh
from bodycam_ros.film.lit_scenery import LitScenery
from bodycam_ros.film.place import Place
from bodycam_ros.film.ray_scene import Floats, RayScene
from bodycam_ros.film.views import UP, Window
from bodycam_ros.geometry import Array, inverse, transform_points
from bodycam_ros.results.colours import GAMMA

Image = NDArray[np.uint8]

_SKY, _OPEN_SKY, _HORIZON, _GROUND, _LINE = np.array(
    [(226, 217, 210), (226, 190, 158), (242, 239, 237), (214, 211, 208), (176, 170, 165)], np.float32
)
"""Blue, green, red."""

_LINE_M, _FADE_M = 0.012, (5.0, 16.0)  # width of the lines of a metre; from where to where the ground fades
_FINEST_M = 0.7  # of the ground in one pixel: beyond, lines a metre apart would flicker
_SAMPLES = 12  # of a pixel at an edge
_JUMP_M = 0.03  # of the distance between neighbouring pixels, at an edge
_AHEAD_M = 0.06  # of a mapped surface before what it hides
_DENSE = 0.5  # of the picture covered by mapped surfaces: with less they hide nothing
_POINT_M, _SMALLEST_PX, _LARGEST_PX = 0.008, 1.1, 4.5  # radius of a point
_PALE, _PALE_FAR = 0.38, 0.72  # how much of the horizon's colour a point has, near and far: the person stands out
_NEAR, _NEAR_GROUND = 0.75, 0.2  # of the person's distance: nearer points would hide the person, and are left out
_SHIFT = 4  # fraction bits of OpenCV's coordinates


class OnGround(NamedTuple):
    """Where rays meet the ground.

    Attributes:
        x, y: (H, W) [m].
        is_ground: (H, W) whether they do.
        along: (H, W) how far from the camera [m].
        directions: (H, W, 3) of the rays.
    """

    x: Floats
    y: Floats
    is_ground: NDArray[np.bool_]
    along: Floats
    directions: Floats


class Band(NamedTuple):
    """Rows of an image that were exposed together, as a rolling shutter exposes its rows.

    Attributes:
        top, bottom: the first row, and the row after the last.
        mesh: the person at that time, with as many vertices as at all others.
        world_T_camera: (4, 4) at that time [m].
    """

    top: int
    bottom: int
    mesh: PosedMesh
    world_T_camera: Array


Shade = Callable[[Floats], tuple[Floats, Floats, Floats]]
"""Rays (N, 3) -> light (N, 3) against them, the share that meets something (N,), and how far away (N,) [m]."""


@dataclass(frozen=True, eq=False)
class PictureMaker:
    """Draws pictures of one lens in one place.

    Attributes:
        lens: of the picture's size.
        window: part of the picture that has an image; nothing is drawn beside it.
        place: around the person.
    """

    lens: CameraModel
    window: Window
    place: Place

    @cached_property
    def _bearings(self) -> tuple[Floats, NDArray[np.bool_]]:
        """(H, W, 3) unit bearings of the pixels, and which of them are drawn on: in the window, and valid."""
        height, width = self.lens.height, self.lens.width
        u, v = np.meshgrid(np.arange(width), np.arange(height))
        bearings, valid = self.lens.unproject(np.stack([u.ravel(), v.ravel()], axis=1).astype(np.float64))
        bearings[~valid] = 0.0, 0.0, -1.0
        left, top, inner_width, inner_height = self.window
        seen = np.zeros((height, width), bool)
        seen[top : top + inner_height, left : left + inner_width] = True
        return bearings.reshape(height, width, 3).astype(np.float32), seen & valid.reshape(height, width)

    @cached_property
    def _scenery(self) -> LitScenery | None:
        return None if self.place.scenery is None else LitScenery(self.place.scenery)

    def covered_share(self, world_T_camera: Array) -> float:
        """Share of the picture that mapped surfaces cover, of a coarse grid of its pixels."""
        if self.place.surface is None:
            return 0.0
        bearings, valid = self._bearings
        coarse = bearings[::16, ::16].reshape(-1, 3)[valid[::16, ::16].ravel()]
        met = self.place.surface.trace(world_T_camera[:3, 3], coarse @ world_T_camera[:3, :3].T.astype(np.float32)).met
        return float(met.mean()) if len(met) else 0.0

    def is_dense(self, world_T_camera: Array) -> bool:
        """Whether mapped surfaces cover enough of the picture to say what is before the person."""
        return self.covered_share(world_T_camera) >= _DENSE

    def draw(
        self,
        mesh: PosedMesh,
        world_T_camera: Array,
        image: Image | None,
        *,
        hidden: bool = False,
        shaded: bool = True,
        bands: Sequence[Band] = (),
    ) -> Image:
        """A picture (H, W, 3), blue, green, red.

        Args:
            mesh: the person and equipment.
            world_T_camera: (4, 4) [m].
            image: (H, W, 3) that the person is drawn over; None from outside.
            hidden: whether mapped surfaces hide what is behind them.
            shaded: whether the person throws a shadow on the ground.
            bands: of an image whose rows were exposed one after the other; in each the person is drawn at its time.
        """
        scene = RayScene(mesh.vertices, mesh.triangles)
        lit = lit_mesh(mesh, scene)
        ground, scenery = self.place.ground_m, self._scenery
        surface = self.place.surface if hidden else None
        if scenery is not None:
            picture, surface = self._in_scenery(world_T_camera, scenery, scene), scenery.rays
        else:
            shadow = None if ground is None or not shaded else ground_shadow(mesh, scene, ground)
            picture = self._background(world_T_camera, mesh, shadow, surface) if image is None else image.copy()
            if image is not None and shadow is not None:
                on_ground = self._on_ground(world_T_camera, self._directions(world_T_camera))
                self._darken(picture, world_T_camera, on_ground, shadow, surface)
        if not bands:
            self._draw_person(picture, lit, scene, world_T_camera, surface)
        for band in bands:
            self._draw_person(
                picture,
                lit.moved(band.mesh),
                RayScene(band.mesh.vertices, band.mesh.triangles),
                band.world_T_camera,
                surface,
                (band.top, band.bottom),
            )
        return picture

    def _sky(self, directions: Floats) -> Floats:
        """(H, W, 3), brightest at the horizon, where the ground fades into it."""
        route = self.place.route
        rise = (directions @ (UP if route is None else route.up).astype(np.float32))[..., None]
        share = np.clip(rise / 0.5, 0.0, 1.0)
        sky: Floats = (1.0 - share) * _HORIZON + share * (_SKY if route is None else _OPEN_SKY)
        return sky

    def _in_scenery(self, world_T_camera: Array, scenery: LitScenery, scene: RayScene) -> Image:
        """Sky and meshes of another program, which the person throws a shadow on."""
        pixels = np.clip(self._sky(self._directions(world_T_camera)), 0.0, 255.0).astype(np.uint8)
        whole = 0, self.lens.height, 0, self.lens.width
        self._trace(pixels, whole, world_T_camera, lambda rays: scenery.shade(world_T_camera[:3, 3], rays, scene))
        return pixels

    def _background(
        self, world_T_camera: Array, mesh: PosedMesh, shadow: GroundShadow | None, surface: RayScene | None
    ) -> Image:
        """Sky, ground and points of the map."""
        directions, route = self._directions(world_T_camera), self.place.route
        picture = self._sky(directions)
        near = mesh.vertices.mean(axis=0)
        if self.place.ground_m is not None and shadow is not None:
            on_ground = self._on_ground(world_T_camera, directions)
            x, y, is_ground, _, _ = on_ground
            away = np.hypot(x - near[0], y - near[1])
            fade = np.clip((away - _FADE_M[0]) / (_FADE_M[1] - _FADE_M[0]), 0.0, 1.0)
            fade = fade * fade * (3.0 - 2.0 * fade)
            line = np.maximum(_line_share(x), _line_share(y))
            ground = _GROUND + line[..., None] * (_LINE - _GROUND)
            if route is not None:
                ground = ground_colours(route, x, y)
                fade = np.clip((away - _FADE_M[1]) / (4.0 * _FADE_M[1]), 0.0, 1.0)
            ground = ground + fade[..., None] * (_HORIZON - ground)
            picture = np.where(is_ground[..., None], ground, picture)
            pixels = np.clip(picture, 0.0, 255.0).astype(np.uint8)
            level = np.abs(self.place.points_world[:, 2] - self.place.ground_m) < 0.05
            self._draw_points(pixels, world_T_camera, near, level, _NEAR_GROUND)
            self._darken(pixels, world_T_camera, on_ground, shadow, surface)
            self._draw_points(pixels, world_T_camera, near, ~level, _NEAR)
            return pixels
        pixels = np.clip(picture, 0.0, 255.0).astype(np.uint8)
        self._draw_points(pixels, world_T_camera, near, np.ones(len(self.place.points_world), bool), _NEAR)
        return pixels

    def _draw_points(
        self, picture: Image, world_T_camera: Array, near: Floats, chosen: NDArray[np.bool_], nearest: float
    ) -> None:
        """Discs of points of the map, the farthest first; none nearer than a share of the person's distance."""
        points = transform_points(inverse(world_T_camera), self.place.points_world[chosen])
        colours = self.place.colours[chosen][:, ::-1]
        distance = float(np.linalg.norm(near - world_T_camera[:3, 3]))
        pixels, valid = self.lens.project(points)
        valid &= (points[:, 2] > nearest * distance) & self.lens.in_image(pixels)
        order = np.flatnonzero(valid)[np.argsort(-points[valid, 2])]
        radii = np.clip(self.lens.fx * _POINT_M / points[order, 2], _SMALLEST_PX, _LARGEST_PX)
        away = np.clip((points[order, 2] - distance) / _FADE_M[1], 0.0, 1.0)
        pale = (_PALE + (_PALE_FAR - _PALE) * away)[:, None]
        shades = np.round(colours[order] * (1.0 - pale) + _HORIZON * pale).astype(int).tolist()
        fixed = np.round(pixels[order] * (1 << _SHIFT)).astype(int).tolist()
        sizes = np.round(radii * (1 << _SHIFT)).astype(int).tolist()
        for centre, radius, colour in zip(fixed, sizes, shades, strict=True):
            cv2.circle(picture, centre, radius, colour, -1, cv2.LINE_AA, _SHIFT)

    def _darken(
        self,
        picture: Image,
        world_T_camera: Array,
        on_ground: OnGround,
        shadow: GroundShadow,
        surface: RayScene | None,
    ) -> None:
        """Put the shadow on the ground where it is seen; ``on_ground``: of ``_on_ground``."""
        x, y, is_ground, along, directions = on_ground
        light = shadow.at(x, y)
        rows, columns = np.nonzero(is_ground & (light < 0.995) & self._bearings[1])
        if surface is not None and len(rows):
            before = surface.trace(world_T_camera[:3, 3], directions[rows, columns]).distances
            seen = before > along[rows, columns] - _AHEAD_M
            rows, columns = rows[seen], columns[seen]
        picture[rows, columns] = np.clip(picture[rows, columns] * light[rows, columns, None], 0.0, 255.0)

    def _on_ground(self, world_T_camera: Array, directions: Floats) -> OnGround:
        """Where rays (H, W, 3) meet the ground."""
        assert self.place.ground_m is not None
        below = np.float32(self.place.ground_m - world_T_camera[2, 3])
        drop = directions[..., 2]
        is_ground = drop * np.sign(below) > 1e-4
        along = np.where(is_ground, below / np.where(is_ground, drop, np.float32(1.0)), np.float32(1e4))
        x = world_T_camera[0, 3].astype(np.float32) + along * directions[..., 0]
        y = world_T_camera[1, 3].astype(np.float32) + along * directions[..., 1]
        return OnGround(x, y, is_ground, along, directions)

    def _draw_person(
        self,
        picture: Image,
        lit: LitMesh,
        scene: RayScene,
        world_T_camera: Array,
        surface: RayScene | None,
        rows_drawn: tuple[int, int] | None = None,
    ) -> None:
        """Trace the pixels around the person, those at edges with many rays, and blend by the share that is met."""
        origin = world_T_camera[:3, 3]

        def shade(directions: Floats) -> tuple[Floats, Floats, Floats]:
            hits = scene.trace(origin, directions)
            rows = np.flatnonzero(hits.met)
            if surface is not None and len(rows):
                before = surface.trace(origin, directions[rows]).distances
                rows = rows[before > hits.distances[rows] - _AHEAD_M]
            colours, met = np.zeros((len(directions), 3), np.float32), np.zeros(len(directions), np.float32)
            far = np.full(len(directions), 1e3, np.float32)
            colours[rows] = lit.colours(hits.triangles[rows], hits.shares[rows], directions[rows])
            met[rows], far[rows] = 1.0, hits.distances[rows]
            return colours, met, far

        top, bottom, left, right = self._around(lit.mesh, world_T_camera)
        if rows_drawn is not None:
            top, bottom = np.clip((top, bottom), *rows_drawn).tolist()
        self._trace(picture, (top, bottom, left, right), world_T_camera, shade)

    def _trace(self, picture: Image, around: tuple[int, int, int, int], world_T_camera: Array, shade: Shade) -> None:
        """Draw what rays of a part of the picture meet."""
        top, bottom, left, right = around
        if top >= bottom or left >= right:
            return
        rotation = world_T_camera[:3, :3].T.astype(np.float32)
        bearings, valid = (each[top:bottom, left:right] for each in self._bearings)
        height, width = valid.shape
        colours, met, far = shade((bearings @ rotation).reshape(-1, 3))
        at_edge = _edges(far.reshape(height, width), colours.reshape(height, width, 3)).ravel()
        rows = np.flatnonzero(at_edge)
        if len(rows):
            right_of = np.gradient(bearings, axis=1).reshape(-1, 3)[rows] if width > 1 else 0.0
            below = np.gradient(bearings, axis=0).reshape(-1, 3)[rows] if height > 1 else 0.0
            u, v = np.modf(np.arange(1, _SAMPLES + 1)[:, None] * np.array([0.7548777, 0.5698403]))[0].T - 0.5
            colours[rows], met[rows] = 0.0, 0.0
            for du, dv in zip(u.astype(np.float32), v.astype(np.float32), strict=True):
                moved = bearings.reshape(-1, 3)[rows] + du * right_of + dv * below
                one, share, _ = shade(moved @ rotation)
                colours[rows] += one / _SAMPLES
                met[rows] += share / _SAMPLES
        met *= valid.ravel()
        rows = np.flatnonzero(met > 0.0)
        part = picture[top:bottom, left:right].reshape(-1, 3)
        under = (part[rows].astype(np.float32) / 255.0) ** GAMMA
        light = under * (1.0 - met[rows, None]) + _toned(colours[rows])[:, ::-1]
        part[rows] = np.round(255.0 * np.clip(light, 0.0, 1.0) ** (1.0 / GAMMA)).astype(np.uint8)
        picture[top:bottom, left:right] = part.reshape(height, width, 3)

    def _around(self, mesh: PosedMesh, world_T_camera: Array) -> tuple[int, int, int, int]:
        """First row, row after the last, first column and column after the last that the person may be in."""
        points = transform_points(inverse(world_T_camera), mesh.vertices.astype(np.float64))
        pixels, valid = self.lens.project(points)
        height, width = self.lens.height, self.lens.width
        if not valid.all():  # some are beside the lens, and so are parts of triangles
            return 0, height, 0, width
        low = np.floor(pixels.min(axis=0)).astype(int) - 2
        high = np.ceil(pixels.max(axis=0)).astype(int) + 3
        left, right = np.clip([low[0], high[0]], 0, width).tolist()
        top, bottom = np.clip([low[1], high[1]], 0, height).tolist()
        return top, bottom, left, right

    def _directions(self, world_T_camera: Array) -> Floats:
        return np.asarray(self._bearings[0] @ world_T_camera[:3, :3].T.astype(np.float32))


def _line_share(at: Floats) -> Floats:
    """How much of each pixel (H, W) the lines at whole metres cover, by one coordinate of its place [m]."""
    wide = np.abs(np.gradient(at, axis=0)) + np.abs(np.gradient(at, axis=1)) + np.float32(1e-6)
    off = np.abs(at - np.round(at))
    share: Floats = np.clip((0.5 * (_LINE_M + wide) - off) / wide, 0.0, 1.0) * np.minimum(1.0, _LINE_M / wide + 0.15)
    return np.asarray(np.where(wide < _FINEST_M, share, 0.0), np.float32)


def _edges(far: Floats, colours: Floats) -> NDArray[np.bool_]:
    """Which pixels (H, W) differ from a neighbour: in distance [m], or in colour."""
    box = np.ones((3, 3), np.uint8)
    jump = cv2.dilate(far, box) - cv2.erode(far, box) > _JUMP_M
    grey = colours.mean(axis=2)
    change = cv2.dilate(grey, box) - cv2.erode(grey, box) > 0.06
    return np.asarray(jump | change, bool)


def _toned(light: Floats) -> Floats:
    """Light (N, 3) with what is brighter than a picture can show bent below 1."""
    knee = np.float32(0.7)
    over = np.maximum(light - knee, 0.0)
    toned: Floats = np.minimum(light, knee) + (1.0 - knee) * (1.0 - np.exp(-over / (1.0 - knee)))
    return toned
