"""A calibration as a picture: where the board was seen, and what errors are left."""

import textwrap
from io import BytesIO
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle
from scipy.stats import binned_statistic

from bodycam_ros.lens.lens_calibration import LensCalibration
from bodycam_ros.lens.lens_quality import CELLS, TRUSTED_RADIUS
from bodycam_ros.results.colours import FAINT, GOOD, INK, QUIET, WARNING
from bodycam_ros.results.picture_style import light_grid, open_picture, panel_title

_INCHES = (13.0, 5.5)
_LETTERS = 165  # of a line of the verdict
_BINS = 12


def calibration_plot(calibration: LensCalibration, title: str) -> bytes:
    """A PNG with two panels."""
    refused, warned = calibration.objections, calibration.warnings
    verdict = f"not to be used: {'; '.join(refused)}" if refused else "; ".join(warned) or "good to use"
    written = BytesIO()
    with open_picture(written, *_INCHES) as figure:
        panels: Any = figure.subplot_mosaic([["seen", "errors"]])
        figure.subplots_adjust(left=0.05, right=0.97, top=0.82, bottom=0.1, wspace=0.08, hspace=0.25)
        figure.text(0.05, 0.962, title, fontsize=13.0, weight="bold", color=INK)
        lines = "\n".join(textwrap.wrap(verdict, _LETTERS))
        figure.text(0.05, 0.953, lines, fontsize=9.0, color=WARNING if refused or warned else GOOD, va="top")
        _draw_coverage(panels["seen"], calibration)
        _draw_errors(panels["errors"], calibration)
    return written.getvalue()


def _draw_coverage(axes: Axes, calibration: LensCalibration) -> None:
    area, fit = calibration.area, calibration.chosen.fit
    panel_title(axes, "Where the board was seen", f"{area.coverage:.0%} of the cells; lacking ones are red")
    _image_axes(axes, calibration)
    height, width = calibration.is_lit.shape
    cell = (width / CELLS[1], height / CELLS[0])
    for row, column in np.argwhere(area.is_lit & ~area.is_covered).tolist():
        at = (column * cell[0] - 0.5, row * cell[1] - 0.5)
        axes.add_patch(Rectangle(at, *cell, facecolor=WARNING, alpha=0.13, edgecolor="white"))
    axes.scatter(fit.pixels[:, 0], fit.pixels[:, 1], s=2.5, c=GOOD, linewidths=0.0)
    turn = np.linspace(0.0, 2.0 * np.pi, 181)
    radius = TRUSTED_RADIUS * area.radius_px
    x, y = 0.5 * (width - 1) + radius * np.cos(turn), 0.5 * (height - 1) + radius * np.sin(turn)
    axes.plot(x, y, color=QUIET, linewidth=0.8, linestyle=(0, (4, 3)))


def _draw_errors(axes: Axes, calibration: LensCalibration) -> None:
    lens = calibration.chosen
    fit = calibration.chosen.fit
    radius = calibration.area.radius_px
    note = f"held out: median {lens.median_px:.2f} px; rays where seen: {lens.worst_ray_px:.2f} px"
    panel_title(axes, "Errors by distance from the centre", note)
    height, width = calibration.is_lit.shape
    at = np.linalg.norm(fit.pixels - 0.5 * np.array([width - 1, height - 1]), axis=1) / radius
    top = max(0.1, float(np.percentile(lens.errors_px, 98.0)) * 1.3)
    axes.scatter(at, np.minimum(lens.errors_px, top), s=3.0, c=QUIET, alpha=0.35, linewidths=0.0)
    for errors, colour, label in (
        (lens.errors_px, INK, "pictures held out, median"),
        (fit.errors_px, GOOD, "pictures fitted, median"),
    ):
        medians, edges, _ = binned_statistic(at, errors, "median", _BINS, (0.0, 1.0))
        axes.plot(0.5 * (edges[:-1] + edges[1:]), medians, color=colour, linewidth=1.6, label=label)
    light_grid(axes)
    axes.set_xlim(0.0, 1.0)
    axes.set_ylim(0.0, top)
    axes.set_xlabel("distance from the centre, of the image radius")
    axes.set_ylabel("error of a point [px]")
    axes.axvline(TRUSTED_RADIUS, color=QUIET, linewidth=0.8, linestyle=(0, (4, 3)))
    axes.legend(loc="upper left")


def _image_axes(axes: Axes, calibration: LensCalibration) -> None:
    height, width = calibration.is_lit.shape
    shade = np.where(calibration.is_lit[..., None], 255, 225).astype(np.uint8)
    axes.imshow(np.repeat(shade, 3, axis=2), extent=(-0.5, width - 0.5, height - 0.5, -0.5))
    axes.set_xlim(-0.5, width - 0.5)
    axes.set_ylim(height - 0.5, -0.5)
    axes.set_aspect("equal")
    axes.set_xticks([])
    axes.set_yticks([])
    for spine in axes.spines.values():
        spine.set_visible(True)
        spine.set_color(FAINT)
