"""A calibration as a picture: where the board was seen, what errors are left, and how far rays are off."""

import textwrap
from io import BytesIO
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from bodycam_ros.lens.lens_calibration import LensCalibration
from bodycam_ros.lens.lens_judgement import TRUSTED_RADIUS, ray_grid
from bodycam_ros.lens.sight_choice import CELLS
from bodycam_ros.plots.picture_style import (
    FAINT,
    GOOD,
    INK,
    LANDMARKS,
    LEFT,
    QUIET,
    TYPOGRAPHY,
    WARNING,
    light_grid,
    panel_title,
)

_INCHES, _DPI = (12.0, 9.0), 110
_ARROWS = (12, 16)  # rows and columns of the field of residuals
_ARROW_PX = 0.045  # of the width, length of the arrow in the legend
_LEAST_IN_ARROW = 3
_LETTERS = 165  # of a line of the verdict
_BINS = 12


def calibration_picture(calibration: LensCalibration, title: str) -> bytes:
    """A PNG with four panels."""
    with mpl.rc_context(TYPOGRAPHY):
        figure = Figure(figsize=_INCHES, dpi=_DPI)
        panels: Any = figure.subplots(2, 2)
        figure.subplots_adjust(left=0.06, right=0.93, top=0.86, bottom=0.07, wspace=0.16, hspace=0.28)
        figure.text(0.06, 0.962, title, fontsize=13.0, weight="bold", color=INK)
        refused = [why for why, _ in calibration.objections]
        verdict = f"not to be used: {'; '.join(refused)}" if refused else "good to use"
        lines = "\n".join(textwrap.wrap(verdict, _LETTERS))
        figure.text(0.06, 0.953, lines, fontsize=9.0, color=WARNING if refused else GOOD, va="top")
        _draw_coverage(panels[0, 0], calibration)
        _draw_residuals(panels[0, 1], calibration)
        _draw_errors(panels[1, 0], calibration)
        _draw_rays(panels[1, 1], calibration)
        written = BytesIO()
        figure.savefig(written, format="png")
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
    _draw_radius(axes, calibration)


def _draw_residuals(axes: Axes, calibration: LensCalibration) -> None:
    fit = calibration.chosen.fit
    height, width = calibration.is_lit.shape
    rows, columns = _ARROWS
    pixels = fit.pixels
    row = np.clip((pixels[:, 1] / height * rows).astype(int), 0, rows - 1)
    column = np.clip((pixels[:, 0] / width * columns).astype(int), 0, columns - 1)
    number = row * columns + column
    middles, arrows = [], []
    for cell in np.unique(number).tolist():
        here = number == cell
        if here.sum() >= _LEAST_IN_ARROW:
            middles.append(pixels[here].mean(axis=0))
            arrows.append(np.median(fit.residuals[here], axis=0))
    unit = max(0.02, float(np.percentile(np.linalg.norm(arrows, axis=1), 90.0))) if arrows else 0.02
    scale = _ARROW_PX * width / unit
    note = "medians; good if they point anywhere"
    panel_title(axes, "What the lens leaves unexplained", note)
    _image_axes(axes, calibration)
    if arrows:
        starts, ends = np.array(middles), np.array(middles) + scale * np.array(arrows)
        axes.add_collection(LineCollection(list(np.stack([starts, ends], axis=1)), colors=LEFT, linewidths=1.0))
        axes.scatter(ends[:, 0], ends[:, 1], s=5.0, c=LEFT, linewidths=0.0)
    length = _ARROW_PX * width
    at = (0.02 * width, 0.965 * height)
    axes.plot([at[0], at[0] + length], [at[1], at[1]], color=INK, linewidth=1.4)
    axes.text(at[0] + 1.2 * length, at[1], f"{unit:.2f} px", va="center", fontsize=8.0)


def _draw_errors(axes: Axes, calibration: LensCalibration) -> None:
    validation, fit, radius = calibration.chosen.validation, calibration.chosen.fit, calibration.area.radius_px
    panel_title(axes, "Errors by distance from the centre", f"left out: median {validation.median_px:.2f} px")
    at = _distance(validation.pixels, calibration) / radius
    top = max(0.1, float(np.percentile(validation.errors_px, 98.0)) * 1.3)
    axes.scatter(at, np.minimum(validation.errors_px, top), s=3.0, c=QUIET, alpha=0.35, linewidths=0.0)
    _draw_medians(axes, at, validation.errors_px, INK, "pictures left out, median")
    _draw_medians(axes, _distance(fit.pixels, calibration) / radius, fit.errors_px, GOOD, "pictures fitted, median")
    _radius_axes(axes, top)
    axes.set_ylabel("error of a point [px]")
    axes.legend(loc="upper left")


def _draw_rays(axes: Axes, calibration: LensCalibration) -> None:
    validation = calibration.chosen.validation
    grid = ray_grid(calibration.is_lit)
    worst = validation.worst_ray_px
    note = f"up to {TRUSTED_RADIUS:.0%} of the radius " + (f"{worst:.2f} px" if np.isfinite(worst) else "without bound")
    panel_title(axes, "By how much rays may be off", note)
    _image_axes(axes, calibration)
    finite = np.where(np.isfinite(validation.ray_errors_px), validation.ray_errors_px, np.nan)
    top = max(0.1, float(np.nanmax(finite))) if np.isfinite(finite).any() else 1.0
    shown = axes.scatter(
        grid[:, 0], grid[:, 1], c=finite, cmap=LANDMARKS, vmin=0.0, vmax=top, s=46.0, marker="s", linewidths=0.0
    )
    lost = grid[~np.isfinite(validation.ray_errors_px)]
    axes.scatter(lost[:, 0], lost[:, 1], c=WARNING, s=46.0, marker="s", linewidths=0.0)
    bar = axes.figure.colorbar(shown, ax=axes, fraction=0.035, pad=0.02)
    bar.set_label("expected error of the ray [px]")


def _draw_medians(axes: Axes, at: np.ndarray[Any, Any], errors: np.ndarray[Any, Any], colour: str, label: str) -> None:
    edges = np.linspace(0.0, 1.0, _BINS + 1)
    bins = np.clip(np.digitize(at, edges) - 1, 0, _BINS - 1)
    full = [k for k in range(_BINS) if (bins == k).sum() >= _LEAST_IN_ARROW]
    middles = [0.5 * (edges[k] + edges[k + 1]) for k in full]
    axes.plot(middles, [float(np.median(errors[bins == k])) for k in full], color=colour, linewidth=1.6, label=label)


def _distance(pixels: np.ndarray[Any, Any], calibration: LensCalibration) -> np.ndarray[Any, Any]:
    height, width = calibration.is_lit.shape
    distance: np.ndarray[Any, Any] = np.linalg.norm(pixels - 0.5 * np.array([width - 1, height - 1]), axis=1)
    return distance


def _radius_axes(axes: Axes, top: float) -> None:
    light_grid(axes)
    axes.set_xlim(0.0, 1.0)
    axes.set_ylim(0.0, top)
    axes.set_xlabel("distance from the centre, of the image radius")
    axes.axvline(TRUSTED_RADIUS, color=QUIET, linewidth=0.8, linestyle=(0, (4, 3)))


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


def _draw_radius(axes: Axes, calibration: LensCalibration) -> None:
    height, width = calibration.is_lit.shape
    turn = np.linspace(0.0, 2.0 * np.pi, 181)
    radius = TRUSTED_RADIUS * calibration.area.radius_px
    x, y = 0.5 * (width - 1) + radius * np.cos(turn), 0.5 * (height - 1) + radius * np.sin(turn)
    axes.plot(x, y, color=QUIET, linewidth=0.8, linestyle=(0, (4, 3)))
