"""The floor as a grid of lines around the middle of the place.

Lines and not a shaded plane: without a graphics card a plane that fills the window doubles the time of a picture.
"""

import numpy as np
from numpy.typing import NDArray
from viser import SceneApi

from bodycam_ros.geometry import Array
from bodycam_ros.view.scene_nodes import GRID, GRID_FINE, WORLD, rgb

_CELL_M, _SECTION_M = 0.5, 1.0
_LINE_PX = 1.0
_MARGIN_M = 2.0
_LEAST_M, _MOST_M = 10.0, 60.0
"""From edge to edge."""


def add_floor(scene: SceneApi, points_world: Array) -> None:
    """Add the floor, z = 0, beneath points (N, 3) of the place [m]; N may be 0."""
    low, high = extent(points_world)
    for step, skipped, colour in ((_CELL_M, _SECTION_M, GRID_FINE), (_SECTION_M, None, GRID)):
        scene.add_line_segments(
            f"{WORLD}/floor/every_{step:g}_m",
            grid_lines(low, high, step, skipped).astype(np.float32),
            rgb(colour),
            thickness=_LINE_PX,
            thickness_units="screen",
        )


def extent(points_world: Array) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Corners (2,), (2,) of a floor beneath nine tenths of the points and the origin, on whole metres [m]."""
    points_xy = np.vstack([points_world[:, :2], np.zeros((1, 2))])
    # A few landmarks, far away through a window, are not the place.
    low, high = np.quantile(points_xy, (0.05, 0.95), axis=0)
    middle = np.round(0.5 * (low + high))
    half = np.ceil(np.clip(0.5 * (high - low) + _MARGIN_M, 0.5 * _LEAST_M, 0.5 * _MOST_M))
    return (middle - half).astype(np.int64), (middle + half).astype(np.int64)


def grid_lines(low: NDArray[np.int64], high: NDArray[np.int64], step_m: float, skipped_m: float | None = None) -> Array:
    """(L, 2, 3) lines between corners (2,), (2,), every so many metres; those every ``skipped_m`` are left out [m]."""
    lines = []
    for axis in (0, 1):
        for at in np.arange(low[axis], high[axis] + 0.5 * step_m, step_m):
            if skipped_m is not None and at % skipped_m == 0.0:
                continue
            line = np.zeros((2, 3))
            line[:, axis] = at
            line[:, 1 - axis] = low[1 - axis], high[1 - axis]
            lines.append(line)
    return np.array(lines)
