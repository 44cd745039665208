"""One picture that shows at a glance whether a solved recording is any good."""

import math
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure, SubFigure

from bodycam_ros.evaluate.blur_panels import draw_blur, draw_brightness
from bodycam_ros.evaluate.comparison import Distribution
from bodycam_ros.evaluate.equipment_panel import draw_equipment
from bodycam_ros.evaluate.evaluation import Evaluation
from bodycam_ros.evaluate.figure_panel import draw_figures, draw_sights, draw_stations
from bodycam_ros.evaluate.summary import CM_PER_M, MM_PER_M
from bodycam_ros.evaluate.time_panels import ANGLE_PANELS, ERROR_PANELS, draw_angles, draw_errors
from bodycam_ros.geometry import Array
from bodycam_ros.plots.picture_style import CAUTION, GOOD, INK, QUIET, TYPOGRAPHY, WARNING
from bodycam_ros.verdict import Level, Verdict

_VERDICT_COLOURS = {Level.GOOD: GOOD, Level.DOUBTFUL: CAUTION, Level.WRONG: WARNING}
_MOST_LETTERS = 150
"""Of the line below the name; the terminal and summary.json have the rest."""

_SIZE_INCHES = (16.0, 11.6)
_BLUR_INCHES = 2.6
_EQUIPMENT_INCHES = 2.6
_DOTS_PER_INCH = 110


def draw_summary(evaluation: Evaluation, path: Path) -> None:
    """Write the picture as PNG.

    Raises:
        OSError: the file cannot be written.
    """
    with matplotlib.rc_context(TYPOGRAPHY):
        width, height = _SIZE_INCHES
        equipment = evaluation.solved.equipment
        heights = [height, _BLUR_INCHES, *([_EQUIPMENT_INCHES] if equipment is not None else [])]
        whole = Figure(figsize=(width, sum(heights)), facecolor="white")
        FigureCanvasAgg(whole)
        figure, strip, *below = whole.subfigures(len(heights), 1, height_ratios=heights, squeeze=False)[:, 0]
        _draw_headline(figure, evaluation, top=0.975)
        draw_figures(figure.add_axes((0.03, 0.545, 0.94, 0.335)), evaluation)
        left, right = (0.095, 0.405), (0.6, 0.365)
        registrations = figure.add_axes((left[0], 0.232, left[1], 0.258))
        if evaluation.cameras:
            draw_sights(registrations, evaluation)
        else:
            draw_stations(registrations, evaluation.solved)
        draw_errors(_stacked(figure, left, (0.045, 0.182), ERROR_PANELS, registrations), evaluation)
        draw_angles(_stacked(figure, right, (0.045, 0.49), ANGLE_PANELS, registrations), evaluation)
        draw_blur(strip.add_axes((left[0], 0.2, left[1], 0.6)), evaluation)
        draw_brightness(strip.add_axes((right[0], 0.2, right[1], 0.6), sharex=registrations), evaluation)
        if equipment is not None:
            panel = below[0].add_axes((left[0], 0.2, right[0] + right[1] - left[0], 0.6), sharex=registrations)
            draw_equipment(panel, evaluation.solved, equipment)
        figure.align_ylabels()
        whole.savefig(path, dpi=_DOTS_PER_INCH, format="png")


def _draw_headline(figure: SubFigure, evaluation: Evaluation, top: float) -> None:
    """Name, duration and key figures, below a height of the figure (0 to 1)."""
    solved = evaluation.solved
    duration_s = 1e-9 * (solved.end_ns - solved.start_ns + solved.frame_ns)
    figure.text(0.03, top, solved.path.resolve().name, fontsize=17.0, weight="bold", va="top")
    what = f"{duration_s:.1f} s, instants: {len(solved.stamps_ns)}, cameras: {_counted(evaluation)}"
    if evaluation.comparison is not None:
        what += f", truth: {evaluation.comparison.truth_name}"
    figure.text(0.03, top - 0.032, what, fontsize=10.0, color=QUIET, va="top")
    colour = _VERDICT_COLOURS[evaluation.verdict.level]
    figure.text(
        0.03, top - 0.055, verdict_line(evaluation.verdict), fontsize=11.0, weight="bold", color=colour, va="top"
    )
    figures = key_figures(evaluation)
    for number, (value, caption) in enumerate(figures):
        across = 0.97 - 0.112 * (len(figures) - 1 - number)
        figure.text(across, top, value, fontsize=17.0, color=INK, va="top", ha="right")
        figure.text(across, top - 0.032, caption, fontsize=9.0, color=QUIET, va="top", ha="right")


def verdict_line(verdict: Verdict) -> str:
    """The verdict and the likely cause of the worst finding, as short as a line is."""
    line = verdict.text
    if verdict.findings and verdict.findings[0].why:
        line += f" ({verdict.findings[0].subject}: {verdict.findings[0].why})"
    return line if len(line) <= _MOST_LETTERS else f"{line[: _MOST_LETTERS - 3]}..."


def key_figures(evaluation: Evaluation) -> list[tuple[str, str]]:
    """(value, caption) of the figures to judge by."""
    figures = [(f"{100.0 * evaluation.image_coverage:.1f} %", "body solved"), *_cameras(evaluation)]
    if evaluation.comparison is None:
        return [
            *figures,
            (_millimetres(evaluation.position_sigma), "root sigma, median"),
            (_millimetres(evaluation.jitter), "jitter, median"),
        ]
    comparison = evaluation.comparison
    rotations = np.degrees([joint.rotation_errors for joint in comparison.joints.values()])
    return [
        *figures[:2],
        (f"{CM_PER_M * float(comparison.position_errors.mean()):.2f} cm", "position error, mean"),
        (f"{float(rotations.mean()):.2f}°", "rotation error, mean"),
        (f"{100.0 * (comparison.scale - 1.0):+.2f} %", "scale error"),
        (f"{np.degrees(comparison.tilt):.2f}°", "tilt"),
    ]


def _counted(evaluation: Evaluation) -> str:
    static = f"{len(evaluation.solved.stations)} static"
    if not evaluation.solved.stations:
        return str(len(evaluation.cameras))
    return f"{len(evaluation.cameras)} and {static}" if evaluation.cameras else static


def _cameras(evaluation: Evaluation) -> list[tuple[str, str]]:
    """(value, caption): how often worn cameras knew where they are; without any, how often static ones saw the body."""
    if evaluation.cameras:
        images = [health.images for health in evaluation.cameras]
        registered = np.average([health.registered for health in evaluation.cameras], weights=images)
        landmarks = np.mean([health.landmarks for health in evaluation.cameras])
        seen = [(f"{landmarks:.0f}", "landmarks per image")] if np.isfinite(landmarks) else []  # not in a slim bag
        return [(f"{100.0 * registered:.1f} %", "cameras registered"), *seen]
    segments = np.concatenate([record.segments for record in evaluation.solved.stations])
    return [(f"{100.0 * np.mean(segments > 0):.1f} %", "body seen"), (f"{segments.mean():.1f}", "segments per image")]


def _stacked(
    figure: SubFigure, across: tuple[float, float], span: tuple[float, float], count: int, shared: Axes
) -> list[Axes]:
    """Panels one upon the other that share their time axis; the lowest shows its ticks."""
    gap = 0.018
    height = (span[1] - span[0] - gap * (count - 1)) / count
    panels = []
    for number in range(count):
        bottom = span[1] - (number + 1) * height - number * gap
        axes = figure.add_axes((across[0], bottom, across[1], height), sharex=shared)
        axes.tick_params(labelbottom=number == count - 1)
        panels.append(axes)
    return panels


def _millimetres(metres: Array) -> str:
    median = MM_PER_M * Distribution.of(metres).median
    return f"{median:.1f} mm" if math.isfinite(median) else "unknown"
