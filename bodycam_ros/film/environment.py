"""A place that was not there: a road, or a slope of snow, that the motion travels along (B figures 8, 13)."""

import re
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import cv2
import numpy as np

from bodycam_ros.errors import ViewError
from bodycam_ros.files.shown import shown
from bodycam_ros.film.ray_scene import Floats
from bodycam_ros.film.scenery import SUFFIX, Scenery, read_scenery
from bodycam_ros.geometry import Array

ROAD, SLOPE, SCENERY = "road", "slope", "scenery"
STEEPEST_DEG = 60.0

_ASPHALT, _VERGE, _PAINT = (np.array(c, np.float32) for c in ((104, 101, 98), (104, 138, 124), (232, 236, 238)))
_SNOW, _TRACK = (np.array(c, np.float32) for c in ((248, 243, 239), (240, 233, 227)))
"""Blue, green, red."""

_LEFT_EDGE_M, _MIDDLE_M, _RIGHT_EDGE_M, _KERB_M = 4.4, 1.4, -1.6, 0.5  # lines of a road, from the middle of the lane
_LINE_M, _DASH_M, _PERIOD_M = 0.12, 3.0, 6.0
_TRACKS_M = 0.25  # apart, of a groomed slope
_GRAIN_M, _GRAIN_CELLS, _GRAIN = 0.04, 512, 14.0  # size of its cells, of the pattern that repeats; strength


@dataclass(frozen=True)
class Environment:
    """A level road, or a slope down which the motion goes.

    A slope is level in the frame of the film, in which up is not z: the motion was recorded on a level floor.

    Attributes:
        kind: ``ROAD``, ``SLOPE`` or ``SCENERY``.
        angle: of a slope to the level [rad].
        speed: that is added to the motion [m/s].
        scenery: of ``SCENERY``, its origin where the motion starts, and x where it goes.
    """

    kind: str
    angle: float = 0.0
    speed: float = 0.0
    scenery: Scenery | None = None

    @classmethod
    def parse(cls, text: str, speed: float) -> "Environment":
        """An environment as a user writes it: ``road``, ``slope:30`` with degrees, or the name of a glTF binary file.

        Raises:
            ViewError: it is none of them, or the file cannot be read.
        """
        if text.lower().endswith(SUFFIX):
            return cls(SCENERY, 0.0, speed, read_scenery(Path(text)))
        if text == ROAD:
            return cls(ROAD, 0.0, speed)
        slope = re.fullmatch(rf"{SLOPE}:(\d+(?:\.\d+)?)", text)
        if slope is None or float(slope[1]) > STEEPEST_DEG:
            raise ViewError(
                f"--environment {shown(text)}: expected road, or slope:30 with at most {STEEPEST_DEG:g} deg"
            )
        return cls(SLOPE, float(np.radians(float(slope[1]))), speed)

    def up(self, heading: Array) -> Array:
        """(3,) unit vector against gravity, where the motion goes along a level heading (3,)."""
        upward: Array = np.cos(self.angle) * np.array([0.0, 0.0, 1.0]) - np.sin(self.angle) * heading
        return upward

    def ground(self, x: Floats, y: Floats, start: Array, heading: Array) -> Floats:
        """Colours (H, W, 3), blue, green, red, of places (H, W) of the ground [m].

        Args:
            x, y: the places.
            start: (3,) where the motion starts [m].
            heading: (3,) unit, level.
        """
        along = (x - start[0]) * np.float32(heading[0]) + (y - start[1]) * np.float32(heading[1])
        across = (y - start[1]) * np.float32(heading[0]) - (x - start[0]) * np.float32(heading[1])
        wide = np.maximum(_change(across), np.float32(1e-4))
        if self.kind == SLOPE:
            off = np.abs(across / _TRACKS_M - np.round(across / _TRACKS_M)) * _TRACKS_M
            share = _band(off, -1.0, 0.08 * _TRACKS_M, wide) * np.clip(1.5 - wide / (0.5 * _TRACKS_M), 0.0, 1.0)
            colours = _SNOW + share[..., None] * (_TRACK - _SNOW)
            return colours + 0.5 * _grain(along, across, wide)[..., None]
        is_road = _band(across, _RIGHT_EDGE_M - _KERB_M, _LEFT_EDGE_M + _KERB_M, wide)
        colours = _VERGE + is_road[..., None] * (_ASPHALT - _VERGE)
        colours = colours + _grain(along, across, wide)[..., None]
        phase = np.mod(along, _PERIOD_M)
        dash = _band(phase, 0.0, _DASH_M, np.maximum(_change(along), np.float32(1e-4)))
        whole = np.ones_like(dash)
        for place, share in ((_LEFT_EDGE_M, whole), (_MIDDLE_M, dash), (_RIGHT_EDGE_M, whole)):
            line = _band(across, place - 0.5 * _LINE_M, place + 0.5 * _LINE_M, wide) * share
            colours = colours + line[..., None] * (_PAINT - colours)
        return np.asarray(colours, np.float32)


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
