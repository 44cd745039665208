"""Strides in one picture: feet over time, and joints over the stride."""

from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from bodycam_ros.drawing.picture_style import INK, LEFT, QUIET, RIGHT, TYPOGRAPHY, light_grid, panel_title
from bodycam_ros.evaluate.walking.foot_events import BALL, HEEL
from bodycam_ros.evaluate.walking.gait import CYCLE, JOINTS, SIDES, Gait
from bodycam_ros.evaluate.walking.gait_figures import CM_PER_M

_SIZE_INCHES = (14.0, 7.6)
_DOTS_PER_INCH = 110
_COLOURS = {"left": LEFT, "right": RIGHT}
_DASHED = (0, (3, 2))
_ROOM_S = 0.3


def draw_gait(gait: Gait, true: Gait | None, path: Path) -> None:
    """Write the picture as PNG.

    Raises:
        OSError: the file cannot be written.
    """
    with matplotlib.rc_context(TYPOGRAPHY):
        figure = Figure(figsize=_SIZE_INCHES, facecolor="white")
        FigureCanvasAgg(figure)
        feet = [figure.add_axes((0.055, bottom, 0.925, 0.185)) for bottom in (0.745, 0.51)]
        for axes, side in zip(feet, SIDES, strict=True):
            _draw_foot(axes, gait, side)
        feet[0].tick_params(labelbottom=False)
        feet[1].set_xlabel("time [s]")
        for number, joint in enumerate(JOINTS):
            axes = figure.add_axes((0.055 + 0.318 * number, 0.075, 0.28, 0.3))
            _draw_joint(axes, gait, true, joint)
        figure.savefig(path, dpi=_DOTS_PER_INCH, format="png")


def _draw_foot(axes: Axes, gait: Gait, side: str) -> None:
    heights = CM_PER_M * gait.soles[side][..., 2]
    first = min(stride.start_s for stride in gait.strides) - _ROOM_S
    last = max(stride.end_s for stride in gait.strides) + _ROOM_S
    for start, end in gait.stances[side]:
        axes.axvspan(start, end, color=_COLOURS[side], alpha=0.12, linewidth=0.0)
    axes.plot(gait.seconds, heights[:, HEEL], color=_COLOURS[side], linewidth=1.5)
    axes.plot(gait.seconds, heights[:, BALL], color=_COLOURS[side], linewidth=1.0, linestyle=_DASHED)
    axes.set_xlim(max(first, float(gait.seconds[0])), min(last, float(gait.seconds[-1])))
    axes.set_ylabel("height [cm]")
    light_grid(axes)
    panel_title(axes, f"{side} foot", f"{len(gait.of(side))} strides; tinted while it stands")
    handles = [
        Line2D([], [], color=_COLOURS[side], linewidth=1.5, label="heel"),
        Line2D([], [], color=_COLOURS[side], linewidth=1.0, linestyle=_DASHED, label="ball"),
    ]
    axes.legend(handles=handles, loc="lower right", bbox_to_anchor=(1.0, 0.98), ncols=2, borderaxespad=0)


def _draw_joint(axes: Axes, gait: Gait, true: Gait | None, joint: str) -> None:
    per_cent = np.arange(CYCLE)
    for side in SIDES:
        curves = np.degrees([stride.angles[joint] for stride in gait.of(side)])
        mean, sd = curves.mean(axis=0), curves.std(axis=0)
        axes.fill_between(per_cent, mean - sd, mean + sd, color=_COLOURS[side], alpha=0.2, linewidth=0.0)
        axes.plot(per_cent, mean, color=_COLOURS[side], linewidth=1.6)
        axes.axvline(100.0 * float(np.mean([stride.stance for stride in gait.of(side)])), color=_COLOURS[side], lw=0.7)
        if true is not None:
            truly = np.degrees([stride.angles[joint] for stride in true.of(side)]).mean(axis=0)
            axes.plot(per_cent, truly, color=INK, linewidth=0.8, linestyle=_DASHED)
    axes.set_xlim(0, CYCLE - 1)
    axes.set_xlabel("stride [%], from heel contact")
    axes.set_ylabel("flexion [°]")
    light_grid(axes)
    panel_title(axes, joint, "mean and sd; the upright lines: the foot leaves the floor" if joint == "hip" else "")
    if joint == "ankle":
        handles = [Line2D([], [], color=colour, linewidth=1.6, label=side) for side, colour in _COLOURS.items()]
        if true is not None:
            handles.append(Line2D([], [], color=INK, linewidth=0.8, linestyle=_DASHED, label="truth"))
        axes.legend(handles=handles, loc="lower right", bbox_to_anchor=(1.0, 0.98), ncols=3, labelcolor=QUIET)
