"""Panels with a row per joint: how far it was moved, what that tells about its place, and how well that fits."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import FixedLocator, NullLocator, StrMethodFormatter

from bodycam_ros.calibration.diagnosis import JointDiagnosis
from bodycam_ros.calibration.report.report_tables import MM_PER_M
from bodycam_ros.drawing.picture_style import FAINT, WARNING, panel_title, side_colour
from bodycam_ros.geometry import Array

_BAR_HEIGHT = 0.2
_BAR_SHADES = (1.0, 0.6, 0.35)
_GAP_TICKS_MM = (0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0, 300.0)
_ROOM = 1.4  # beyond the least and the greatest gap, as a factor
_LEAST_GAP_MM = 0.01  # a logarithm needs an end; nobody measures less


def draw_exercise(axes: Axes, joints: Sequence[JointDiagnosis]) -> None:
    """Three bars per joint: the range about each of its principal axes, the largest on top [deg]."""
    for row, joint in enumerate(joints):
        for number, degrees in enumerate(np.degrees(joint.exercised_rad)):
            axes.barh(
                row + (number - 1) * (_BAR_HEIGHT + 0.04),
                degrees,
                _BAR_HEIGHT,
                color=WARNING if joint.advice else side_colour(joint.name),
                alpha=_BAR_SHADES[number],
            )
    axes.set_ylim(len(joints) - 0.4, -0.6)
    axes.set_yticks(range(len(joints)), [joint.name.replace("_", " ") for joint in joints])
    for label, joint in zip(axes.get_yticklabels(), joints, strict=True):
        label.set_color(WARNING if joint.advice else side_colour(joint.name))
    axes.set_xlabel("[°] about its three axes")
    _rows(axes, len(joints))
    panel_title(axes, "Exercised")


def draw_singular_values(axes: Axes, joints: Sequence[JointDiagnosis]) -> None:
    """Three dots per joint: 1 where its place is known by motion, 0 where nothing tells it (A eq. 14)."""
    for row, joint in enumerate(joints):
        colour = WARNING if joint.advice else side_colour(joint.name)
        values = joint.singular_values
        axes.plot(values, np.full(len(values), row), "o", color=colour, markersize=5.0, alpha=0.75, clip_on=False)
    axes.set_xlim(0.0, max([1.0, *(float(joint.singular_values.max()) for joint in joints)]))
    axes.xaxis.set_major_locator(FixedLocator([0.0, 0.5, 1.0]))
    axes.set_xlabel("0: nothing tells")
    _rows(axes, len(joints))
    _without_names(axes)
    panel_title(axes, "Singular values")


def draw_gaps(axes: Axes, joints: Sequence[JointDiagnosis]) -> None:
    """From the gap between its two segments before the refinement to that after it, median [mm]."""
    gaps_mm = MM_PER_M * np.array([(joint.residual_m, joint.refined_residual_m) for joint in joints])
    gaps_mm = np.maximum(gaps_mm, _LEAST_GAP_MM)  # what is not known stays so, and is not drawn
    for row, (joint, (before, after)) in enumerate(zip(joints, gaps_mm, strict=True)):
        colour = WARNING if joint.advice else side_colour(joint.name)
        axes.plot([before, after], [row, row], color=colour, linewidth=1.2, alpha=0.6)
        axes.plot(before, row, "o", markersize=5.5, markerfacecolor="white", markeredgecolor=colour)
        axes.plot(after, row, "o", markersize=5.5, color=colour)
    low, high = _ends(gaps_mm)
    axes.set_xscale("log")
    axes.set_xlim(low, high)
    axes.xaxis.set_major_locator(FixedLocator([tick for tick in _GAP_TICKS_MM if low <= tick <= high]))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axes.set_xlabel("[mm] \N{WHITE CIRCLE} before \N{BLACK CIRCLE} after")
    _rows(axes, len(joints))
    _without_names(axes)
    panel_title(axes, "Gap", "median")


def _ends(values: Array) -> tuple[float, float]:
    """Of a logarithmic scale that holds all known values with room around them, and a decade at least."""
    known = values[np.isfinite(values)] if np.isfinite(values).any() else np.ones(1)
    middle = float(np.sqrt(known.min() * known.max()))
    factor = float(max(_ROOM * np.sqrt(known.max() / known.min()), np.sqrt(10.0)))
    return middle / factor, middle * factor


def _rows(axes: Axes, count: int) -> None:
    """Lines between the rows, and at the ticks of the value axis."""
    axes.hlines(np.arange(count - 1) + 0.5, 0.0, 1.0, transform=axes.get_yaxis_transform(), color=FAINT, linewidth=0.7)
    axes.grid(axis="x", color=FAINT, linewidth=0.7)
    axes.set_axisbelow(True)
    axes.spines["left"].set_visible(False)
    axes.tick_params(axis="y", length=0.0)
    axes.tick_params(axis="x", length=2.5, width=0.6)


def _without_names(axes: Axes) -> None:
    """The names stand at the first panel of the row."""
    axes.tick_params(axis="y", labelleft=False)
