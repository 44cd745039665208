"""By how much joints have turned, ours and theirs, and how far they are off (A figure 7)."""

from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from bodycam_ros.drawing.picture_style import CENTRE, INK, LEFT, RIGHT, TYPOGRAPHY, light_grid, panel_title, side_colour
from bodycam_ros.evaluate.agreement.agreement import Agreement
from bodycam_ros.evaluate.agreement.agreement_figures import CM_PER_M
from bodycam_ros.evaluate.agreement.anatomical_angles import JOINTS, kind_and_side
from bodycam_ros.geometry import Array
from bodycam_ros.solved.solved_recording import GAP_FRAMES, SolvedRecording

_UPPER, _LOWER = ("spine", "neck", "shoulder", "elbow"), ("hip", "knee", "ankle")
_ROOT = "pelvis"
_COLUMNS = 4
_SIZE_INCHES = (16.0, 10.0)
_DOTS_PER_INCH = 110
_DASHED = (0, (3, 2))


def draw_joints(solved: SolvedRecording, agreement: Agreement, path: Path) -> None:
    """Write the picture as PNG: upper body above, lower body below, as in the paper; angles, then positions.

    Raises:
        OSError: the file cannot be written.
    """
    with matplotlib.rc_context(TYPOGRAPHY):
        figure = Figure(figsize=_SIZE_INCHES, facecolor="white")
        FigureCanvasAgg(figure)
        panels = figure.subplots(4, _COLUMNS, sharex=True, squeeze=False)
        turned = dict.fromkeys((*_UPPER, *_LOWER), False)
        for row, joints in enumerate((_UPPER, _LOWER)):
            for axes, joint in zip(panels[row], joints, strict=False):
                turned[joint] = _draw_turned(axes, solved, agreement, joint)
            for axes, joint in zip(panels[2 + row], (*joints, _ROOT)[:_COLUMNS], strict=False):
                _draw_off(axes, solved, agreement, joint)
        panels[1][-1].axis("off")
        panels[1][-1].legend(handles=_key(agreement), loc="center left", fontsize=9.0)
        for row, what in enumerate(("turned [°]", "turned [°]", "off [cm]", "off [cm]")):
            panels[row][0].set_ylabel(what)
        for axes in panels[-1]:
            axes.set_xlabel("time [s]")
        figure.align_ylabels()
        figure.subplots_adjust(left=0.05, right=0.985, bottom=0.055, top=0.96, wspace=0.16, hspace=0.34)
        figure.savefig(path, dpi=_DOTS_PER_INCH, format="png")


def _draw_turned(axes: Axes, solved: SolvedRecording, agreement: Agreement, joint: str) -> bool:
    """Angles of a kind of joint; whether there are any."""
    errors = []
    for angle in agreement.angles:
        if JOINTS.get(kind_and_side(angle.segment)[0]) != joint:
            continue
        errors.append(np.degrees(agreement.angle_errors[angle.segment]))
        axes.plot(*_curve(solved, agreement, np.degrees(angle.ours_turned)), color=side_colour(angle.segment), lw=1.5)
        axes.plot(
            *_curve(solved, agreement, np.degrees(angle.theirs_turned)), color=INK, linewidth=0.8, linestyle=_DASHED
        )
    _finish(axes, joint, np.array(errors), "°")
    return bool(errors)


def _draw_off(axes: Axes, solved: SolvedRecording, agreement: Agreement, joint: str) -> None:
    """Position errors of a kind of joint."""
    errors = []
    for point in agreement.joints:
        kind, _ = kind_and_side(point.link)
        if JOINTS.get(kind, kind) != joint:
            continue
        errors.append(CM_PER_M * point.errors)
        axes.plot(*_curve(solved, agreement, errors[-1]), color=side_colour(point.link), linewidth=1.2)
    axes.set_ylim(bottom=0.0)
    _finish(axes, joint, np.array(errors), " cm")


def _finish(axes: Axes, joint: str, errors: Array, unit: str) -> None:
    known = errors[np.isfinite(errors)]
    panel_title(axes, joint, f"error {known.mean():.2f}{unit} mean" if known.size else "not known")
    if known.size:
        light_grid(axes)
    else:
        axes.set_yticks([])
        axes.spines["left"].set_visible(False)


def _curve(solved: SolvedRecording, agreement: Agreement, values: Array) -> tuple[Array, Array]:
    """Times (N,) [s] and values (N,), with a NaN in each gap."""
    stamps_ns = agreement.stamps_ns
    after = np.flatnonzero(np.diff(stamps_ns) > GAP_FRAMES * max(solved.frame_ns, solved.instant_ns)) + 1
    return np.insert(solved.seconds(stamps_ns), after, np.nan), np.insert(values, after, np.nan)


def _key(agreement: Agreement) -> list[Line2D]:
    lines = [Line2D([], [], color=c, label=name) for name, c in (("left", LEFT), ("right", RIGHT), ("trunk", CENTRE))]
    return [*lines, Line2D([], [], color=INK, linewidth=0.9, linestyle=_DASHED, label=agreement.name)]
