"""A picture of camera images with landmarks and the wearer's own limbs drawn over them."""

from collections.abc import Sequence
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from bodycam_ros.evaluate.distribution import Distribution
from bodycam_ros.evaluate.overlay import CAMERAS, OverlayView
from bodycam_ros.evaluate.picture_style import QUIET, TYPOGRAPHY, WARNING, panel_title, side_colour

_COLUMNS = 3
_PANEL_INCHES = (5.3, 4.3)
_DOTS_PER_INCH = 110
_WHITE_PERCENTILE = 99.5
_GOOD, _GOOD_PX = "#35e0c4", 3.0
"""Landmarks this near to their tracks are drawn as good; on grey images a light colour shows."""


def draw_overlays(views: Sequence[OverlayView], path: Path) -> None:
    """Write the picture as PNG: a point per named track, a line to its landmark, limbs in their side's colour.

    Raises:
        OSError: the file cannot be written.
    """
    rows = -(-CAMERAS // _COLUMNS)
    with matplotlib.rc_context(TYPOGRAPHY):
        figure = Figure(figsize=(_COLUMNS * _PANEL_INCHES[0], rows * _PANEL_INCHES[1]), facecolor="white")
        FigureCanvasAgg(figure)
        for axes, view in zip(figure.subplots(rows, _COLUMNS).flat, [*views, *[None] * CAMERAS], strict=False):
            axes.axis("off")
            if view is not None:
                _draw_view(axes, view)
        figure.text(
            0.015,
            0.012,
            f"Points: named tracks, green if the landmark falls within {_GOOD_PX:g} px in the solved pose, else red "
            "with a line to where it falls. Thick lines: the wearer's limbs as solved.",
            color=QUIET,
        )
        figure.subplots_adjust(left=0.015, right=0.985, top=0.95, bottom=0.045, wspace=0.04, hspace=0.14)
        figure.savefig(path, dpi=_DOTS_PER_INCH, format="png")


def _draw_view(axes: Axes, view: OverlayView) -> None:
    height, width = view.image.shape
    brightest = max(float(np.percentile(view.image, _WHITE_PERCENTILE)), 1.0)  # images may be dark
    axes.imshow(view.image, cmap="gray", vmin=0.0, vmax=brightest, interpolation="nearest")
    for segment, line in view.limbs:
        axes.plot(*line.T, color=side_colour(segment), linewidth=3.0, alpha=0.75, solid_capstyle="round")
    good = view.errors <= _GOOD_PX
    colours = np.where(good, _GOOD, WARNING)
    lines = np.stack([view.pixels, view.projected], axis=1)
    axes.add_collection(LineCollection(list(lines[~good]), colors=WARNING, linewidths=0.9))
    axes.scatter(
        view.pixels[:, 0], view.pixels[:, 1], s=9.0, facecolors="none", edgecolors=colours.tolist(), linewidths=1.0
    )
    axes.set_xlim(-0.5, width - 0.5)
    axes.set_ylim(height - 0.5, -0.5)
    state = "" if view.registered else ", LOST"
    error = f", {Distribution.of(view.errors).median:.2f} px median" if len(view.pixels) else ""
    note = f"{view.seconds:.2f} s, {len(view.pixels)} landmarks{error}{state}"
    panel_title(axes, view.camera.replace("_", " "), note)
