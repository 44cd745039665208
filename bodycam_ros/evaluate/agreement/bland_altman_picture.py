"""How two systems agree about joint angles: difference over mean (Bland and Altman 1986), per joint and plane."""

from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from bodycam_ros.calibration.anatomy import JOINT_ABOVE
from bodycam_ros.drawing.picture_style import CENTRE, INK, LEFT, QUIET, RIGHT, TYPOGRAPHY, light_grid, side_colour
from bodycam_ros.evaluate.agreement.agreement import Agreement, AngleAgreement
from bodycam_ros.evaluate.agreement.anatomical_angles import PLANES, kind_and_side, meaning
from bodycam_ros.evaluate.agreement.spread import LimitsOfAgreement
from bodycam_ros.evaluate.page.page import number
from bodycam_ros.geometry import Array

_PANEL_INCHES = (2.7, 2.3)
_KEY_INCHES, _TITLE_INCHES = 0.75, 0.6
_DOTS_PER_INCH = 110
_MOST_DOTS = 1500
"""Of a joint; more are one blot."""

_LEAST_DEG = 0.05  # that an axis of differences spans to each side


def draw_bland_altman(agreement: Agreement, path: Path) -> None:
    """Write the picture as PNG: a row per plane, a column per kind of joint, both sides in one panel.

    Raises:
        OSError: the file cannot be written.
    """
    kinds = _kinds(agreement)
    with matplotlib.rc_context(TYPOGRAPHY):
        width = max(3, len(kinds)) * _PANEL_INCHES[0]
        height = len(PLANES) * _PANEL_INCHES[1] + _KEY_INCHES + _TITLE_INCHES
        figure = Figure(figsize=(width, height), facecolor="white")
        FigureCanvasAgg(figure)
        panels = figure.subplots(len(PLANES), len(kinds), squeeze=False)
        for row, plane in enumerate(PLANES):
            for column, (joint, angles) in enumerate(kinds.items()):
                what = meaning(angles[0].segment)[row]
                _draw_panel(panels[row][column], angles, row, f"{joint}, {what}")
            panels[row][0].set_ylabel(f"{plane} plane\nours less theirs [°]")
        for axes in panels[-1]:
            axes.set_xlabel("mean of both [°]")
        handles = [
            Line2D([], [], color=colour, linestyle="", marker="o", markersize=4.0, label=name)
            for name, colour in (("left", LEFT), ("right", RIGHT), ("trunk", CENTRE))
        ]
        handles.append(Line2D([], [], color=INK, linewidth=1.2, label="bias"))
        handles.append(Line2D([], [], color=INK, linewidth=0.8, linestyle="--", label="95 % of the differences"))
        figure.legend(handles=handles, loc="lower center", ncols=len(handles))
        figure.align_ylabels()
        figure.subplots_adjust(
            left=0.95 / width, right=1.0 - 0.15 / width, bottom=(_KEY_INCHES + 0.1) / height,
            top=1.0 - _TITLE_INCHES / height, wspace=0.3, hspace=0.42,
        )  # fmt: skip
        figure.savefig(path, dpi=_DOTS_PER_INCH, format="png")


def _kinds(agreement: Agreement) -> dict[str, list[AngleAgreement]]:
    """Kind of joint -> its sides, in the order of ``JOINT_ABOVE``."""
    found: dict[str, list[AngleAgreement]] = {}
    for angle in agreement.angles:
        kind = kind_and_side(angle.segment)[0]
        found.setdefault(JOINT_ABOVE.get(kind, kind), []).append(angle)
    order = [*JOINT_ABOVE.values()]
    return dict(sorted(found.items(), key=lambda item: order.index(item[0]) if item[0] in order else len(order)))


def _draw_panel(axes: Axes, angles: list[AngleAgreement], plane: int, title: str) -> None:
    ours, theirs = (np.degrees([of(angle)[:, plane] for angle in angles]) for of in (_ours, _theirs))
    axes.set_title(title, fontsize=9.0, loc="left")
    if not np.isfinite(theirs).any():
        what = "not told by\ncentres of joints"
        axes.text(0.5, 0.5, what, transform=axes.transAxes, ha="center", va="center", color=QUIET)
        axes.set_xticks([])
        axes.set_yticks([])
        return
    limits = LimitsOfAgreement.of(ours, theirs)
    for angle, a, b in zip(angles, ours, theirs, strict=True):
        some = slice(None, None, -(-len(a) // _MOST_DOTS))
        axes.plot(
            (a + b)[some] / 2.0, (a - b)[some], ".", color=side_colour(angle.segment), markersize=3.5, alpha=0.5,
            markeredgewidth=0.0,
        )  # fmt: skip
    axes.axhline(0.0, color=QUIET, linewidth=0.5)
    for value, style, width in ((limits.bias, "-", 1.2), (limits.low, "--", 0.8), (limits.high, "--", 0.8)):
        axes.axhline(value, color=INK, linewidth=width, linestyle=style)
    for value, place, across, up in (
        (limits.high, "bottom", 1.0, 2), (limits.low, "top", 1.0, -2), (limits.bias, "bottom", 0.0, 2),
    ):  # fmt: skip
        axes.annotate(
            number(value, signed=True), (across, value), (2 - 4 * across, up), xycoords=("axes fraction", "data"),
            textcoords="offset points", ha="right" if across else "left", va=place, fontsize=7.5, color=INK,
        )  # fmt: skip
    difference = np.abs(ours - theirs)
    reach = max(_LEAST_DEG, 1.25 * float(np.nanmax(difference)))
    axes.set_ylim(-reach, reach)
    light_grid(axes)


def _ours(angle: AngleAgreement) -> Array:
    return angle.ours


def _theirs(angle: AngleAgreement) -> Array:
    return angle.theirs
