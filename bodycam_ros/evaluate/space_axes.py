"""A box of space to draw ways in: the same scale along all axes, seen from a side."""

from typing import Any

import numpy as np

from bodycam_ros.geometry import Array
from bodycam_ros.plots.picture_style import FAINT

_ELEVATION_DEG = 16.0
_FOCAL_LENGTH = 0.6  # of matplotlib's camera: the nearer foot is seen to be larger
_MOST_TICKS = 5
_LABEL_PAD = 9.0
_SMALLEST = {"mm": 20.0, "m": 0.2}
"""Of an axis: a foot that rests shall look so."""


def frame_space(axes: Any, points: Array, azimuth_deg: float, unit: str = "mm", zoom: float = 0.88) -> None:
    """A box around points (N, 3) in a unit, with the same scale along all axes, seen from an azimuth."""
    low, high = np.nanmin(points, axis=0), np.nanmax(points, axis=0)
    middle, half = (low + high) / 2.0, np.maximum((high - low) / 2.0, _SMALLEST[unit] / 2.0) * 1.06
    axes.set_proj_type("persp", focal_length=_FOCAL_LENGTH)
    axes.view_init(elev=_ELEVATION_DEG, azim=azimuth_deg)
    for name, centre, reach in zip("xyz", middle.tolist(), half.tolist(), strict=True):
        getattr(axes, f"set_{name}lim")(centre - reach, centre + reach)
        getattr(axes, f"set_{name}label")(f"{name} [{unit}]", labelpad=_LABEL_PAD)
        side = getattr(axes, f"{name}axis")
        side.set_pane_color((1.0, 1.0, 1.0, 0.0))
        side._axinfo["grid"].update(color=FAINT, linewidth=0.7)
        axes.locator_params(axis=name, nbins=max(2, round(_MOST_TICKS * reach / float(half.max()))))
    axes.set_box_aspect(half, zoom=zoom)
