"""A calibrated body and how well it is known, in one picture."""

import textwrap
from collections.abc import Sequence
from io import BytesIO

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, NullLocator, StrMethodFormatter

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.calibration.diagnosis import CalibrationDiagnosis, JointDiagnosis
from bodycam_ros.geometry import Array
from bodycam_ros.plots.body_views import draw_views
from bodycam_ros.plots.picture_style import FAINT, INK, QUIET, TYPOGRAPHY, WARNING, panel_title, side_colour
from bodycam_ros.plots.report_tables import MM_PER_M

_WIDTH = 16.0  # [in] here and below
_HEADLINE = 1.35
_VIEWS = 7.5
_BELOW_VIEWS = 0.75
_TITLE = 0.26
_LINE = 0.19
_DOTS_PER_INCH = 110
_LINE_LETTERS = 185
_MOST_LINES = 12
_MARGIN = 0.03  # of the width

_BAR_HEIGHT = 0.2
_BAR_SHADES = (1.0, 0.6, 0.35)
_GAP_TICKS_MM = (0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0, 300.0)
_ROOM = 1.4  # beyond the least and the greatest gap, as a factor
_LEAST_GAP_MM = 0.01  # a logarithm needs an end; nobody measures less


def body_png(body: BodyModel, diagnosis: CalibrationDiagnosis) -> bytes:
    """The picture as a PNG file's content."""
    content = BytesIO()
    with matplotlib.rc_context(TYPOGRAPHY):
        body_figure(body, diagnosis).savefig(content, dpi=_DOTS_PER_INCH, format="png")
    return content.getvalue()


def body_figure(body: BodyModel, diagnosis: CalibrationDiagnosis) -> Figure:
    """The N-pose from the front and from the right, a row of panels per joint, and what to look at."""
    lines = _fitted(diagnosis.warnings)
    below = _BELOW_VIEWS + _TITLE + _LINE * (len(lines) + 1)
    height = _HEADLINE + _VIEWS + below
    with matplotlib.rc_context(TYPOGRAPHY):
        figure = Figure(figsize=(_WIDTH, height), dpi=_DOTS_PER_INCH, facecolor="white")
        FigureCanvasAgg(figure)
        _draw_headline(figure, body, diagnosis)
        upright = below / height, _VIEWS / height
        front = figure.add_axes((_MARGIN, upright[0], 0.35, upright[1]))
        side = figure.add_axes((0.385, upright[0], 0.145, upright[1]), sharey=front)
        draw_views(front, side, body, diagnosis)
        motion = figure.add_axes((0.625, upright[0], 0.145, upright[1]))
        values = figure.add_axes((0.79, upright[0], 0.08, upright[1]), sharey=motion)
        gap = figure.add_axes((0.89, upright[0], 0.08, upright[1]), sharey=motion)
        draw_exercise(motion, diagnosis.joints)
        draw_singular_values(values, diagnosis.joints)
        draw_gaps(gap, diagnosis.joints)
        _draw_warnings(figure, lines)
    return figure


def _draw_headline(figure: Figure, body: BodyModel, diagnosis: CalibrationDiagnosis) -> None:
    top, second = (1.0 - inches / figure.get_figheight() for inches in (0.28, 0.66))
    figure.text(_MARGIN, top, f"Body {body.name}", fontsize=17.0, weight="bold", va="top")
    start_s, end_s = diagnosis.rest_s
    what = f"{diagnosis.duration_s:.1f} s of motion, N-pose from {start_s:.1f} to {end_s:.1f} s"
    figure.text(_MARGIN, second, what, fontsize=10.0, color=QUIET, va="top")
    figures = key_figures(diagnosis)
    for number, (value, caption) in enumerate(figures):
        across = 1.0 - _MARGIN - 0.128 * (len(figures) - 1 - number)
        figure.text(across, top, value, fontsize=15.0, color=INK, va="top", ha="right")
        figure.text(across, second, caption, fontsize=9.0, color=QUIET, va="top", ha="right")


def key_figures(diagnosis: CalibrationDiagnosis) -> list[tuple[str, str]]:
    """(value, caption) of the figures to judge by."""
    figures = [(f"{len(diagnosis.joints)}", "joints"), (f"{len(diagnosis.cameras)}", "cameras")]
    if diagnosis.stature_m is not None:
        figures.append((f"{diagnosis.stature_m:.2f} m", "stature by the bones"))
    if (gain := diagnosis.refinement) is not None:
        figures.append((f"{MM_PER_M * gain.moved_m:.1f} mm", "joints moved by refinement"))
        figures.append((f"{gain.before_px:.2f} → {gain.after_px:.2f} px", "reprojection, median"))
    return figures


def _draw_warnings(figure: Figure, lines: list[str]) -> None:
    """At the foot of the figure, the last line above its edge."""
    from_bottom = _LINE * (len(lines) + 1)
    title, colour = ("Look at", WARNING) if lines else ("No warnings", QUIET)
    height = figure.get_figheight()
    figure.text(_MARGIN, (from_bottom + _TITLE) / height, title, fontsize=10.0, weight="bold", color=colour, va="top")
    for number, line in enumerate(lines):
        figure.text(_MARGIN, (from_bottom - number * _LINE) / height, line, fontsize=9.0, va="top")


def _fitted(warnings: tuple[str, ...]) -> list[str]:
    """As many of the warnings as there is room for, and how many are left."""
    lines: list[str] = []
    for number, warning in enumerate(warnings):
        wrapped = textwrap.wrap(f"{number + 1}.  {warning}", _LINE_LETTERS, subsequent_indent="     ")
        last = number == len(warnings) - 1
        if len(lines) + len(wrapped) > (_MOST_LINES if last else _MOST_LINES - 1):
            return [*lines, f"and {len(warnings) - number} more, in the tables"]
        lines += wrapped
    return lines


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
    axes.set_xlabel("0: not at all")
    _rows(axes, len(joints))
    _without_names(axes)
    panel_title(axes, "Place known")


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
    panel_title(axes, "Joint gap")


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
