"""Colours of the ground of an environment: asphalt with lines, or snow with tracks."""

from functools import cache

import cv2
import numpy as np

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
    SLOPE,
    SNOW,
    TRACK,
    TRACK_SHARE,
    TRACKS_M,
    VERGE,
)
from bodycam_ros.environment.placement import Route
from bodycam_ros.film.ray_scene import Floats
from bodycam_ros.results.colours import rgb

_GRAIN_M, _GRAIN_CELLS, _GRAIN = 0.04, 512, 14.0  # size of its cells, of the pattern that repeats; strength


def ground_colours(route: Route, x: Floats, y: Floats) -> Floats:
    """Colours (H, W, 3), blue, green, red, of places (H, W) of the ground [m].

    Args:
        route: where the motion goes, and in which environment.
        x, y: the places, in the world.
    """
    asphalt, verge, paint, snow, track = (_bgr(each) for each in (ASPHALT, VERGE, PAINT, SNOW, TRACK))
    start, heading = route.start, route.heading
    along = (x - start[0]) * np.float32(heading[0]) + (y - start[1]) * np.float32(heading[1])
    across = (y - start[1]) * np.float32(heading[0]) - (x - start[0]) * np.float32(heading[1])
    wide = np.maximum(_change(across), np.float32(1e-4))
    if route.environment.kind == SLOPE:
        off = np.abs(across / TRACKS_M - np.round(across / TRACKS_M)) * TRACKS_M
        share = _band(off, -1.0, 0.5 * TRACK_SHARE * TRACKS_M, wide) * np.clip(1.5 - wide / (0.5 * TRACKS_M), 0.0, 1.0)
        colours = snow + share[..., None] * (track - snow)
        return colours + 0.5 * _grain(along, across, wide)[..., None]
    is_road = _band(across, RIGHT_EDGE_M - KERB_M, LEFT_EDGE_M + KERB_M, wide)
    colours = verge + is_road[..., None] * (asphalt - verge)
    colours = colours + _grain(along, across, wide)[..., None]
    phase = np.mod(along, PERIOD_M)
    dash = _band(phase, 0.0, DASH_M, np.maximum(_change(along), np.float32(1e-4)))
    whole = np.ones_like(dash)
    for place, share in ((LEFT_EDGE_M, whole), (MIDDLE_M, dash), (RIGHT_EDGE_M, whole)):
        line = _band(across, place - 0.5 * LINE_M, place + 0.5 * LINE_M, wide) * share
        colours = colours + line[..., None] * (paint - colours)
    return np.asarray(colours, np.float32)


def _bgr(colour: str) -> Floats:
    return np.array(rgb(colour)[::-1], np.float32)


def _change(at: Floats) -> Floats:
    """How much a value (H, W) changes from a pixel to the next."""
    change: Floats = np.abs(np.gradient(at, axis=0)) + np.abs(np.gradient(at, axis=1))
    return change


def _band(value: Floats, low: float, high: float, wide: Floats) -> Floats:
    """How much of pixels (H, W), in which a value changes by ``wide``, lies from ``low`` to ``high``."""
    from_low, to_high = (value - low) / wide + 0.5, (high - value) / wide + 0.5
    share: Floats = np.clip(np.minimum(from_low, to_high), 0.0, 1.0) * np.minimum(1.0, (high - low) / wide)
    return share


@cache
def _grain_patterns() -> tuple[Floats, Floats]:
    """Noise, and the same coarser; the same in every picture."""
    noise = np.random.default_rng(7).normal(size=(_GRAIN_CELLS, _GRAIN_CELLS)).astype(np.float32)
    return noise, np.asarray(cv2.GaussianBlur(noise, (0, 0), 8.0, borderType=cv2.BORDER_REFLECT) * 16.0, np.float32)


def _grain(along: Floats, across: Floats, wide: Floats) -> Floats:
    """A pattern (H, W) that shows motion, fading where its cells are smaller than pixels."""
    noise, coarse = _grain_patterns()
    grain = np.zeros_like(along)
    for pattern, cell, strength in ((noise, _GRAIN_M, 0.5), (coarse, 2.0 * _GRAIN_M, 0.6)):
        columns, rows = ((np.mod(each / cell, _GRAIN_CELLS)).astype(np.float32) for each in (along, across))
        drawn = cv2.remap(pattern, columns, rows, cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP)
        reach = cell if pattern is noise else 8.0 * cell
        grain += strength * _GRAIN * drawn * np.clip(1.5 - wide / reach, 0.0, 1.0)
    return grain
