"""Inertial sensors against the solved body: what each gyroscope measures beyond its camera's turn, over time."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.colors import LogNorm

from bodycam_ros.geometry import Array
from bodycam_ros.picture_style import LANDMARKS, open_picture, panel_title, side_colour

_WIDTH, _ROW, _MARGINS = 10.0, 0.28, 0.85  # [in]
_COLUMN_S = 0.2  # of a cell, at least; several states, so that one image does not decide
_MAX_COLUMNS = 300
_LEAST, _MOST = 0.3, 30.0  # [deg/s] ends of the scale: noise of the solved turn from image to image, and a sensor off


@dataclass(frozen=True, eq=False)
class GyroscopeResiduals:
    """One gyroscope, corrected by the body file, less the solved angular velocity of its camera.

    Attributes:
        seconds: (N,) since the first state [s].
        rad_s: (N, 3) in the camera's axes, means from state to state [rad/s].
    """

    seconds: Array
    rad_s: Array


def draw_sensors(residuals: Mapping[str, GyroscopeResiduals], path: Path) -> None:
    """Write a picture with a row for each camera: medians of its residual [deg/s], darker the larger."""
    end_s = max(float(each.seconds.max()) for each in residuals.values())
    edges = np.linspace(0.0, end_s, int(np.clip(end_s / _COLUMN_S, 1, _MAX_COLUMNS)) + 1)
    table = np.full((len(residuals), len(edges) - 1), np.nan)
    for row, each in enumerate(residuals.values()):
        size, column = np.degrees(np.linalg.norm(each.rad_s, axis=1)), np.digitize(each.seconds, edges[1:-1])
        for cell in np.unique(column).tolist():
            table[row, cell] = np.median(size[column == cell])
    with open_picture(path, _WIDTH, _MARGINS + _ROW * len(residuals)) as figure:
        axes = figure.add_axes((0.13, 0.45 / figure.get_figheight(), 0.85, 1.0 - _MARGINS / figure.get_figheight()))
        extent = (0.0, end_s, len(residuals) - 0.5, -0.5)
        image = axes.imshow(
            np.clip(table, _LEAST, _MOST), cmap=LANDMARKS, norm=LogNorm(_LEAST, _MOST), extent=extent, aspect="auto",
            interpolation="nearest",
        )  # fmt: skip
        axes.set_yticks(range(len(residuals)), [camera.replace("_", " ") for camera in residuals])
        for label, camera in zip(axes.get_yticklabels(), residuals, strict=True):
            label.set_color(side_colour(camera))
        axes.set_xlabel("s")
        axes.spines[:].set_visible(False)
        panel_title(axes, "Gyroscopes against the solved cameras", "difference of angular velocities, deg/s")
        bar = figure.colorbar(image, ax=axes, pad=0.02, ticks=[_LEAST, 1.0, 3.0, 10.0, _MOST])
        bar.ax.set_yticklabels(["0.3", "1", "3", "10", "30"])
        bar.outline.set_visible(False)
