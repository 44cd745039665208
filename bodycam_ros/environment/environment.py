"""A place that was not there: a road, or a slope of snow, that the motion travels along (B figures 8, 13)."""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bodycam_ros.environment.scenery import SUFFIX, Scenery, read_scenery
from bodycam_ros.errors import ViewError
from bodycam_ros.files.shown import shown
from bodycam_ros.geometry import Array

ROAD, SLOPE, SCENERY = "road", "slope", "scenery"
STEEPEST_DEG = 60.0

LEFT_EDGE_M, MIDDLE_M, RIGHT_EDGE_M, KERB_M = 4.4, 1.4, -1.6, 0.5
"""Lines of a road, from the middle of the lane to the left; asphalt beyond the outer ones [m]."""
LINE_M, DASH_M, PERIOD_M = 0.12, 3.0, 6.0
"""Width of a line, length of a dash, and from one dash to the next [m]."""
TRACKS_M, TRACK_SHARE = 0.25, 0.16
"""Tracks of a groomed slope: apart [m], and how wide in shares of that."""
ASPHALT, VERGE, PAINT, SNOW, TRACK = "#626568", "#7c8a68", "#eeece8", "#eff3f8", "#e3e9f0"
"""Colours of a road, of what is beside it, of its lines; of snow, and of tracks in it."""


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
