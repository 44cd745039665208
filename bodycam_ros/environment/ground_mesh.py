"""The ground of an environment as meshes of few colours, for files that have no textures: a road, or a slope."""

from dataclasses import dataclass

import numpy as np

from bodycam_ros.body.surface import Faces
from bodycam_ros.environment.environment import (
    ASPHALT,
    DASH_M,
    KERB_M,
    LEFT_EDGE_M,
    LINE_M,
    MIDDLE_M,
    PAINT,
    PERIOD_M,
    RIGHT_EDGE_M,
    ROAD,
    SLOPE,
    SNOW,
    TRACK,
    TRACK_SHARE,
    TRACKS_M,
    VERGE,
    Environment,
)
from bodycam_ros.geometry import Array, exp_so3
from bodycam_ros.results.colours import rgb

_BEHIND_M, _AHEAD_M, _ASIDE_M = 20.0, 60.0, 30.0  # of the motion
_CELL_M, _MOST_CELLS = 2.0, 400  # along the ground: patches differ a little, which shows how it passes
_GROOMED = 0.5  # share of a slope's half width that has tracks
_SHADES = (-0.025, 0.0, 0.025)


@dataclass(frozen=True, eq=False)
class ColouredMesh:
    """A mesh of one colour.

    Attributes:
        vertices: (V, 3) [m].
        triangles: (T, 3) rows of them.
        colour: ``#rrggbb``.
    """

    vertices: Array
    triangles: Faces
    colour: str


def ground_meshes(environment: Environment, first_m: float, last_m: float) -> tuple[ColouredMesh, ...]:
    """The ground around a motion, in the frame of the environment: z against gravity, x of a slope down it.

    Args:
        environment: a road or a slope; scenery has its own ground, and none is made.
        first_m, last_m: where along the ground the motion begins and ends.
    """
    if environment.kind not in (ROAD, SLOPE):
        return ()
    low, high = first_m - _BEHIND_M, last_m + _AHEAD_M
    strips = _road() if environment.kind == ROAD else _slope()
    cell = max(_CELL_M, (high - low) / _MOST_CELLS)
    shades = np.random.default_rng(7)
    quads: dict[str, list[tuple[float, float, float, float]]] = {}
    for right, left, colour, is_patched in strips:
        if is_patched:
            edges = np.linspace(low, high, 1 + int(np.ceil((high - low) / cell)))
            for start, end in zip(edges, edges[1:], strict=False):
                quads.setdefault(_shaded(colour, shades.choice(_SHADES)), []).append((start, end, right, left))
        else:
            quads.setdefault(colour, []).append((low, high, right, left))
    if environment.kind == ROAD:
        right, left = MIDDLE_M - 0.5 * LINE_M, MIDDLE_M + 0.5 * LINE_M
        for start in np.arange(np.floor(low / PERIOD_M), np.ceil(high / PERIOD_M)) * PERIOD_M:
            quads.setdefault(PAINT, []).append((start, start + DASH_M, right, left))
            quads.setdefault(ASPHALT, []).append((start + DASH_M, start + PERIOD_M, right, left))
    tilt = exp_so3(np.array([0.0, environment.angle, 0.0]))
    return tuple(ColouredMesh(*_rectangles(np.array(each), tilt), colour) for colour, each in quads.items())


def _road() -> list[tuple[float, float, str, bool]]:
    """Strips between two places across, to the left, with a colour, and whether its patches differ.

    The dashed line in the middle is left out.
    """
    half = 0.5 * LINE_M
    right, left = RIGHT_EDGE_M - KERB_M, LEFT_EDGE_M + KERB_M
    lines = [(place - half, place + half) for place in (RIGHT_EDGE_M, MIDDLE_M, LEFT_EDGE_M)]
    asphalt = zip([right, *(end for _, end in lines)], [*(start for start, _ in lines), left], strict=True)
    verge = [*_between(-_ASIDE_M, right), *_between(left, _ASIDE_M)]
    return [
        *((start, end, VERGE, True) for start, end in verge),
        *((start, end, ASPHALT, True) for start, end in asphalt),
        *((start, end, PAINT, False) for start, end in (lines[0], lines[2])),
    ]


def _slope() -> list[tuple[float, float, str, bool]]:
    """Strips of snow, with tracks where it is groomed."""
    number = int(_GROOMED * _ASIDE_M / TRACKS_M)
    half = 0.5 * TRACK_SHARE * TRACKS_M
    tracks = [(TRACKS_M * row - half, TRACKS_M * row + half) for row in range(-number, number + 1)]
    between = [(end, start) for (_, end), (start, _) in zip(tracks, tracks[1:], strict=False)]
    beside = [*_between(-_ASIDE_M, tracks[0][0]), *_between(tracks[-1][1], _ASIDE_M)]
    return [
        *((start, end, TRACK, False) for start, end in tracks),
        *((start, end, SNOW, True) for start, end in (*between, *beside)),
    ]


def _between(right: float, left: float) -> list[tuple[float, float]]:
    edges = np.linspace(right, left, 1 + int(np.ceil((left - right) / 4.0))).tolist()
    return list(zip(edges, edges[1:], strict=False))


def _shaded(colour: str, by: float) -> str:
    values = np.array(rgb(colour)) * (1.0 + by)
    return "#" + bytes(np.clip(np.round(values), 0, 255).astype(np.uint8)).hex()


def _rectangles(quads: Array, tilt: Array) -> tuple[Array, Faces]:
    """Vertices and triangles, facing up, of rectangles (N, 4): start and end along, right and left across."""
    start, end, right, left = quads.T
    flat = np.zeros_like(start)
    corners = [np.stack([x, y, flat], axis=1) for x, y in ((start, right), (end, right), (end, left), (start, left))]
    vertices = np.stack(corners, axis=1).reshape(-1, 3) @ tilt.T
    fan = np.array([(0, 1, 2), (0, 2, 3)], np.int32)
    return vertices, (4 * np.arange(len(quads), dtype=np.int32)[:, None, None] + fan).reshape(-1, 3)
