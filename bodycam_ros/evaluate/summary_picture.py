"""One picture that shows at a glance whether a solved recording is any good."""

import math
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from bodycam_ros.body.equipment_report import EquipmentRecord
from bodycam_ros.evaluate.comparison import Distribution
from bodycam_ros.evaluate.evaluation import Evaluation
from bodycam_ros.evaluate.figure_panel import draw_figures
from bodycam_ros.evaluate.registration_panel import draw_registrations
from bodycam_ros.evaluate.summary import CM_PER_M, MM_PER_M
from bodycam_ros.evaluate.time_panels import ANGLE_PANELS, ERROR_PANELS, draw_angles, draw_errors
from bodycam_ros.geometry import Array
from bodycam_ros.picture_style import (
    CAUTION,
    GOOD,
    INK,
    QUIET,
    WARNING,
    light_grid,
    open_picture,
    panel_title,
    side_colour,
)
from bodycam_ros.results.solved_recording import SolvedRecording
from bodycam_ros.verdict import Level, Verdict

_VERDICT_COLOURS = {Level.GOOD: GOOD, Level.DOUBTFUL: CAUTION, Level.WRONG: WARNING}
_MAX_LETTERS = 150
"""Of the line below the name; the report and summary.json have the rest."""

_WIDTH, _HEIGHT, _EQUIPMENT_HEIGHT = 16.0, 11.6, 2.6  # [in]
_LEFT_COLUMN, _RIGHT_COLUMN = (0.095, 0.405), (0.6, 0.365)
_MIN_GAP_MM = 0.1  # lower end of the logarithmic scale of equipment; cameras measure no less
_DASHES: tuple[tuple[int, tuple[int, ...]], ...] = ((0, ()), (0, (6, 2)), (0, (3, 1, 1, 1)), (0, (1, 1)))
"""Of attachments, by name without the side."""


def draw_summary(evaluation: Evaluation, path: Path) -> None:
    """Write the picture as PNG.

    Raises:
        OSError: the file cannot be written.
    """
    equipment = evaluation.solved.equipment
    height = _HEIGHT + (_EQUIPMENT_HEIGHT if equipment is not None else 0.0)
    with open_picture(path, _WIDTH, height) as figure:

        def add_panel(column: tuple[float, float], bottom: float, top: float, shared: Axes | None = None) -> Axes:
            """Axes between two heights, given as shares of a picture without equipment."""
            low, high = (1.0 - (1.0 - share) * _HEIGHT / height for share in (bottom, top))
            return figure.add_axes((column[0], low, column[1], high - low), sharex=shared)

        _draw_headline(figure, evaluation, height)
        draw_figures(add_panel((0.03, 0.94), 0.545, 0.88), evaluation)
        registrations = add_panel(_LEFT_COLUMN, 0.232, 0.49)
        draw_registrations(registrations, evaluation)
        for draw, column, (bottom, top), count in (
            (draw_errors, _LEFT_COLUMN, (0.055, 0.182), ERROR_PANELS),
            (draw_angles, _RIGHT_COLUMN, (0.055, 0.49), ANGLE_PANELS),
        ):
            gap, panels = 0.018, []
            each = (top - bottom + gap) / count
            for index in range(count):
                high = top - index * each
                panels.append(add_panel(column, high - each + gap, high, registrations))
                panels[-1].tick_params(labelbottom=index == count - 1)
            draw(panels, evaluation)
        if equipment is not None:
            panel = add_panel((0.095, 0.87), -0.16, -0.03, registrations)
            draw_equipment(panel, evaluation.solved, equipment)
        figure.align_ylabels()


def _draw_headline(figure: Figure, evaluation: Evaluation, height: float) -> None:
    """Name, duration, verdict and key figures."""
    solved = evaluation.solved
    name, below, verdict = (1.0 - inches / height for inches in (0.29, 0.66, 0.93))
    duration_s = 1e-9 * (solved.end_ns - solved.start_ns + solved.frame_ns)
    figure.text(0.03, name, solved.path.resolve().name, fontsize=17.0, weight="bold", va="top")
    what = f"{duration_s:.1f} s, frames: {len(solved.stamps_ns)}, cameras: {len(evaluation.cameras)}"
    if solved.stations:
        what += f", static cameras: {len(solved.stations)}"
    if evaluation.comparison is not None:
        what += f", truth: {evaluation.comparison.truth_name}"
    elif evaluation.agreement is not None:
        what += f", compared with {evaluation.agreement.name}"
    figure.text(0.03, below, what, fontsize=10.0, color=QUIET, va="top")
    colour = _VERDICT_COLOURS[evaluation.verdict.level]
    figure.text(0.03, verdict, verdict_line(evaluation.verdict), fontsize=11.0, weight="bold", color=colour, va="top")
    figures = key_figures(evaluation)
    for index, (value, caption) in enumerate(figures):
        across = 0.97 - 0.112 * (len(figures) - 1 - index)
        figure.text(across, name, value, fontsize=17.0, color=INK, va="top", ha="right")
        figure.text(across, below, caption, fontsize=9.0, color=QUIET, va="top", ha="right")


def verdict_line(verdict: Verdict) -> str:
    """The verdict and the likely cause of the worst finding, shortened to a line."""
    line = verdict.text
    if verdict.findings and verdict.findings[0].why:
        line += f" ({verdict.findings[0].subject}: {verdict.findings[0].why})"
    return line if len(line) <= _MAX_LETTERS else f"{line[: _MAX_LETTERS - 3]}..."


def key_figures(evaluation: Evaluation) -> list[tuple[str, str]]:
    """(value, caption) of the figures to judge by."""
    solved = (f"{100.0 * evaluation.image_coverage:.1f} %", "body solved")
    cameras = _camera_figures(evaluation)
    if (comparison := evaluation.comparison) is not None:
        rotations = np.degrees([joint.rotation_errors for joint in comparison.joints.values()])
        return [
            solved,
            cameras[0],
            (f"{CM_PER_M * float(comparison.position_errors.mean()):.2f} cm", "position error, mean"),
            (f"{float(rotations.mean()):.2f}°", "rotation error, mean"),
            (f"{100.0 * (comparison.scale - 1.0):+.2f} %", "scale error"),
            (f"{np.degrees(comparison.tilt):.2f}°", "tilt"),
        ]
    if (agreement := evaluation.agreement) is not None:
        off = CM_PER_M * float(np.nanmean(agreement.position_errors))
        return [solved, *cameras, (f"{off:.2f} cm", "position difference, mean")]
    sigma, jitter = (_millimetres(values) for values in (evaluation.position_sigma, evaluation.jitter))
    return [solved, *cameras, (sigma, "root sigma, median"), (jitter, "jitter, median")]


def _camera_figures(evaluation: Evaluation) -> list[tuple[str, str]]:
    """How often body cameras were registered; without any, how often static ones measured the body."""
    if not evaluation.cameras:
        segments = np.concatenate([record.segments for record in evaluation.solved.stations])
        observed = (f"{100.0 * np.mean(segments > 0):.1f} %", "body observed")
        return [observed, (f"{segments.mean():.1f}", "segments per image")]
    registered = np.average(
        [each.registered for each in evaluation.cameras], weights=[c.images for c in evaluation.cameras]
    )
    landmarks = np.mean([each.landmarks for each in evaluation.cameras])
    counted = [(f"{landmarks:.0f}", "landmarks per image")] if np.isfinite(landmarks) else []  # not in a slim bag
    return [(f"{100.0 * registered:.1f} %", "cameras registered"), *counted]


def _millimetres(metres: Array) -> str:
    median = MM_PER_M * Distribution.of(metres).median
    return f"{median:.1f} mm" if math.isfinite(median) else "unknown"


def draw_equipment(axes: Axes, solved: SolvedRecording, record: EquipmentRecord) -> None:
    """Draw the distance of each attachment's points over time (B figure 12), thin and faint while it was released."""
    panel_title(axes, f"Distance from {record.name}", "between points that should coincide; faint: released")
    kinds = list(dict.fromkeys(map(_kind, record.attachments)))
    low, high = np.inf, 10.0 * _MIN_GAP_MM
    handles = []
    for column, name in enumerate(record.attachments):
        distance = np.maximum(MM_PER_M * record.deviations[:, column], _MIN_GAP_MM)
        known = distance[np.isfinite(distance)]
        if known.size:
            low, high = min(low, float(known.min())), max(high, float(known.max()))
        style: Any = {"color": side_colour(name), "linestyle": _DASHES[kinds.index(_kind(name)) % len(_DASHES)]}
        held = record.held[:, column]
        for mask, width, alpha in ((held, 1.5, 1.0), (~held, 0.8, 0.45)):
            # A step longer at the beginning of each stretch, so that lines meet.
            shown = mask | np.append(mask[1:], False)
            curve = solved.curve(record.stamps_ns, np.where(shown, distance, np.nan))
            axes.plot(*curve, linewidth=width, alpha=alpha, **style)
        handles.append(Line2D([], [], label=name, linewidth=1.5, **style))
    axes.set_yscale("log")
    axes.set_ylim(min(low, high / 10.0) / 1.5, high * 1.5)
    axes.yaxis.set_major_formatter("{x:g}")
    axes.set_ylabel("distance [mm]")
    axes.set_xlabel("time [s]")
    if not record.placed.any():
        axes.text(0.5, 0.5, "its pose was never known", transform=axes.transAxes, ha="center", color=QUIET)
    axes.legend(handles=handles, loc="lower right", bbox_to_anchor=(1.0, 0.98), ncols=len(handles), borderaxespad=0)
    light_grid(axes)


def _kind(name: str) -> str:
    return name.removesuffix("_left").removesuffix("_right")
