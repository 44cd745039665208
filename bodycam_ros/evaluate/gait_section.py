"""A gait in figures: its part of ``summary.json``."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from bodycam_ros.evaluate.gait import BALL, CRITERION, CYCLE, HEEL, JOINTS, SIDES, Gait, Stride
from bodycam_ros.evaluate.page import Block, Heading, Picture, Table, Text, number
from bodycam_ros.plots.picture_style import INK, LEFT, QUIET, RIGHT, TYPOGRAPHY, light_grid, panel_title

CM_PER_M = 100.0


@dataclass(frozen=True)
class Measure:
    """What is said of every stride.

    Attributes:
        name: as people read it, with the unit.
        key: in ``summary.json``.
        of: a stride -> its value in that unit.
        decimals: that are shown.
        is_symmetric: whether the two sides of a healthy person are alike in it, so that the index says something.
    """

    name: str
    key: str
    of: Callable[[Stride], float]
    decimals: int
    is_symmetric: bool = True


def _range_of(joint: str) -> Callable[[Stride], float]:
    return lambda stride: float(np.degrees(stride.range_of(joint)))


MEASURES: Sequence[Measure] = (
    Measure("stride time [s]", "stride_s", lambda stride: stride.duration, 3),
    Measure("cadence [steps/min]", "cadence_per_min", lambda stride: 120.0 / stride.duration, 1),
    Measure("stride length [m]", "stride_m", lambda stride: stride.length, 3),
    Measure("step length [m]", "step_m", lambda stride: stride.step_length, 3),
    Measure("step width [cm]", "step_width_cm", lambda stride: CM_PER_M * stride.step_width, 1, is_symmetric=False),
    Measure("walking speed [m/s]", "speed_m_s", lambda stride: stride.speed, 3, is_symmetric=False),
    Measure("stance [%]", "stance_percent", lambda stride: 100.0 * stride.stance, 1),
    Measure("swing [%]", "swing_percent", lambda stride: 100.0 * (1.0 - stride.stance), 1),
    Measure(
        "double support [%]", "double_support_percent", lambda stride: 100.0 * stride.double_support, 1,
        is_symmetric=False,
    ),
    Measure("clearance of the ball [cm]", "clearance_cm", lambda stride: CM_PER_M * stride.clearance, 1),
    Measure("rise of the heel [cm]", "heel_rise_cm", lambda stride: CM_PER_M * stride.heel_rise, 1),
    *(Measure(f"{joint}, range [deg]", f"{joint}_range_deg", _range_of(joint), 1) for joint in JOINTS),
)  # fmt: skip


@dataclass(frozen=True)
class Told:
    """Mean and standard deviation over strides; NaN of none."""

    mean: float
    sd: float

    @classmethod
    def of(cls, strides: Sequence[Stride], measure: Measure) -> "Told":
        """Of a measure of strides; those of which it is not known do not count."""
        values = np.array([measure.of(stride) for stride in strides])
        known = values[np.isfinite(values)]
        return cls(float(known.mean()), float(known.std())) if known.size else cls(np.nan, np.nan)


def symmetry_index(gait: Gait, measure: Measure) -> float:
    """Left less right over the mean of both [%] (Robinson, Herzog and Nigg 1987); 0 is symmetric."""
    left, right = (Told.of(gait.of(side), measure).mean for side in SIDES)
    middle = (left + right) / 2.0
    return 100.0 * (left - right) / middle if middle else np.nan


def gait_figures(gait: Gait) -> Mapping[str, Any]:
    """Figures by name, the unit at the end of the name: of all strides, of each side, and how symmetric they are."""
    return {
        "strides": {side: len(gait.of(side)) for side in SIDES},
        **{
            measure.key: {
                "mean": Told.of(gait.strides, measure).mean,
                "sd": Told.of(gait.strides, measure).sd,
                **{side: Told.of(gait.of(side), measure).mean for side in SIDES},
                **({"symmetry_percent": symmetry_index(gait, measure)} if measure.is_symmetric else {}),
            }
            for measure in MEASURES
        },
    }


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


GAIT = "gait.png"
"""File of the section's picture."""


def gait_section(gait: Gait, true: Gait | None) -> tuple[Block, ...]:
    """What is said of a gait, with the true one beside it if that is known."""
    counts = " and ".join(f"{len(gait.of(side))} of the {side} foot" for side in SIDES)
    return (
        Heading("Walking"),
        Text(
            f"Means and standard deviations over {counts}. A stride goes from where the heel is furthest ahead of the "
            "pelvis to where it is so again, its swing from where the ball is furthest behind (Zeni 2008). Heel and "
            "ball are two points of the sole, as deep and as long as the shin tells. Symmetry: left less right over "
            "their mean."
        ),
        Text(f"What counts as walking: {CRITERION}."),
        Table(gait_columns(true), gait_rows(gait, true)),
        Picture(
            GAIT, "Heights of heel and ball, with stances, and flexion over the stride: mean and standard deviation."
        ),
    )


def gait_columns(true: Gait | None) -> Sequence[str]:
    """Headings of ``gait_rows``."""
    return ("measure", "all", "+-", *SIDES, "symmetry [%]", *(("truth", "off") if true is not None else ()))


def gait_rows(gait: Gait, true: Gait | None) -> list[tuple[str, ...]]:
    """A row of cells per measure."""
    rows = []
    for measure in MEASURES:
        of_all = Told.of(gait.strides, measure)
        sides = (number(Told.of(gait.of(side), measure).mean, measure.decimals) for side in SIDES)
        symmetry = number(symmetry_index(gait, measure), 1, signed=True) if measure.is_symmetric else ""
        row = (
            measure.name, number(of_all.mean, measure.decimals), number(of_all.sd, measure.decimals), *sides, symmetry
        )  # fmt: skip
        if true is not None:
            truly = Told.of(true.strides, measure).mean
            off = number(of_all.mean - truly, measure.decimals, signed=True)
            row = (*row, number(truly, measure.decimals), off)
        rows.append(row)
    return rows
