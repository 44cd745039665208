"""The figures that matter most, large, on top of the picture."""

import math

import numpy as np
from matplotlib.figure import Figure

from bodycam_ros.drawing.picture_style import INK, QUIET
from bodycam_ros.evaluate.evaluation import Evaluation
from bodycam_ros.evaluate.measures import Distribution
from bodycam_ros.evaluate.summary import CM_PER_M, MM_PER_M
from bodycam_ros.geometry import Array


def draw_headline(figure: Figure, evaluation: Evaluation, top: float) -> None:
    """Draw name, duration and key figures, below a height of the figure (0 to 1)."""
    solved = evaluation.solved
    duration_s = 1e-9 * (solved.end_ns - solved.start_ns + solved.frame_ns)
    figure.text(0.03, top, solved.path.resolve().name, fontsize=17.0, weight="bold", va="top")
    what = f"{duration_s:.1f} s, instants: {len(solved.stamps_ns)}, cameras: {len(evaluation.cameras)}"
    if evaluation.comparison is not None:
        what += f", against the truth of {evaluation.comparison.truth_name}"
    figure.text(0.03, top - 0.032, what, fontsize=10.0, color=QUIET, va="top")
    figures = key_figures(evaluation)
    for number, (value, caption) in enumerate(figures):
        across = 0.97 - 0.112 * (len(figures) - 1 - number)
        figure.text(across, top, value, fontsize=17.0, color=INK, va="top", ha="right")
        figure.text(across, top - 0.032, caption, fontsize=9.0, color=QUIET, va="top", ha="right")


def key_figures(evaluation: Evaluation) -> list[tuple[str, str]]:
    """(value, caption) of the figures to judge by."""
    registered = np.average([h.registered for h in evaluation.cameras], weights=[h.images for h in evaluation.cameras])
    landmarks = np.mean([h.landmarks for h in evaluation.cameras])
    figures = [
        (f"{100.0 * evaluation.image_coverage:.1f} %", "body solved"),
        (f"{100.0 * registered:.1f} %", "cameras registered"),
        (f"{landmarks:.0f}", "landmarks per image"),
    ]
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


def _millimetres(metres: Array) -> str:
    median = MM_PER_M * Distribution.of(metres).median
    return f"{median:.1f} mm" if math.isfinite(median) else "unknown"
