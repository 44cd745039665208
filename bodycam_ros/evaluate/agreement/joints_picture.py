"""By how much joints have turned, ours and theirs, and how far they are off (A figure 7)."""

from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from bodycam_ros.calibration.anatomy import JOINT_ABOVE
from bodycam_ros.drawing.picture_style import CENTRE, INK, LEFT, RIGHT, TYPOGRAPHY, light_grid, panel_title, side_colour
from bodycam_ros.evaluate.agreement.agreement import Agreement
from bodycam_ros.evaluate.agreement.agreement_figures import CM_PER_M
from bodycam_ros.evaluate.agreement.anatomical_angles import kind_and_side
from bodycam_ros.geometry import Array
from bodycam_ros.solved.solved_recording import GAP_FRAMES, SolvedRecording

_UPPER, _LOWER = ("spine", "neck", "shoulder", "elbow"), ("hip", "knee", "ankle")
_ROOT = "pelvis"
_COLUMNS = 4
_WIDTH_INCHES, _ROW_INCHES, _KEY_INCHES = 16.0, 2.5, 0.3
_DOTS_PER_INCH = 110
_DASHED = (0, (3, 2))


def draw_joints(solved: SolvedRecording, agreement: Agreement, path: Path) -> None:
    """Write the picture as PNG: upper body above, lower body below, as in the paper; angles, then positions.

    Raises:
        OSError: the file cannot be written.
    """
    has_angles = bool(agreement.angles)
    count = 4 if has_angles else 2
    with matplotlib.rc_context(TYPOGRAPHY):
        height = _ROW_INCHES * count
        figure = Figure(figsize=(_WIDTH_INCHES, height + _KEY_INCHES), facecolor="white")
        FigureCanvasAgg(figure)
        panels = figure.subplots(count, _COLUMNS, sharex=True, squeeze=False)
        off = panels[count - 2 :]
        for row, joints in enumerate((_UPPER, _LOWER)):
            if has_angles:
                for axes, joint in zip(panels[row], joints, strict=False):
                    _draw_turned(axes, solved, agreement, joint)
                panels[row][0].set_ylabel("turned [°]")
            for axes, joint in zip(off[row], (*joints, _ROOT)[:_COLUMNS], strict=False):
                _draw_off(axes, solved, agreement, joint)
            off[row][0].set_ylabel("off [cm]")
        if has_angles:
            panels[1][-1].axis("off")
        for axes in panels[-1]:
            axes.set_xlabel("time [s]")
        handles = _key(agreement, has_angles)
        figure.legend(handles=handles, loc="lower center", ncols=len(handles))
        figure.align_ylabels()
        figure.subplots_adjust(
            left=0.05, right=0.985, bottom=(0.5 + _KEY_INCHES) / (height + _KEY_INCHES), top=1.0 - 0.4 / height,
            wspace=0.16, hspace=0.34,
        )  # fmt: skip
        figure.savefig(path, dpi=_DOTS_PER_INCH, format="png")


def _draw_turned(axes: Axes, solved: SolvedRecording, agreement: Agreement, joint: str) -> None:
    """Angles of a kind of joint."""
    errors = []
    for angle in agreement.angles:
        if JOINT_ABOVE.get(kind_and_side(angle.segment)[0]) != joint:
            continue
        errors.append(np.degrees(agreement.angle_errors[angle.segment]))
        axes.plot(*_curve(solved, agreement, np.degrees(angle.ours_turned)), color=side_colour(angle.segment), lw=1.5)
        axes.plot(
            *_curve(solved, agreement, np.degrees(angle.theirs_turned)), color=INK, linewidth=0.8, linestyle=_DASHED
        )
    _finish(axes, joint, np.array(errors), "°")


def _draw_off(axes: Axes, solved: SolvedRecording, agreement: Agreement, joint: str) -> None:
    """Position errors of a kind of joint."""
    errors = []
    for point in agreement.joints:
        kind, _ = kind_and_side(point.link)
        if JOINT_ABOVE.get(kind, kind) != joint:
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


def _key(agreement: Agreement, has_angles: bool) -> list[Line2D]:
    lines = [Line2D([], [], color=c, label=name) for name, c in (("left", LEFT), ("right", RIGHT), ("trunk", CENTRE))]
    theirs = Line2D([], [], color=INK, linewidth=0.9, linestyle=_DASHED, label=agreement.name)
    return [*lines, theirs] if has_angles else lines
