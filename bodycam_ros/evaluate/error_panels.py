"""Panels: the error over time where the truth is known, else what the solver itself believes."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import LogLocator, NullLocator

from bodycam_ros.drawing.picture_style import INK, QUIET, TRUTH, WARNING, light_grid, panel_title
from bodycam_ros.evaluate.comparison import Comparison
from bodycam_ros.evaluate.evaluation import Evaluation
from bodycam_ros.evaluate.summary import MM_PER_M
from bodycam_ros.evaluate.time_curve import broken_at_gaps, lone_marker
from bodycam_ros.geometry import Array

PANELS = 2

_SHORT_SCALE = 50.0  # ends of the scale: up to this ratio there are ticks at 3 and 30 too
_ROOM = 1.3  # beyond the least and the greatest value, as a factor
_LEAST_ERROR = 1e-3  # [mm] and [deg] a logarithm needs an end; below this nobody can measure


def draw_errors(panels: Sequence[Axes], evaluation: Evaluation) -> None:
    """Draw two panels, of position and of rotation, with instants that no camera speaks about in red."""
    if evaluation.comparison is not None:
        _draw_true_errors(panels, evaluation, evaluation.comparison)
    else:
        _draw_own_doubts(panels, evaluation)
    for axes in panels:
        light_grid(axes)
        _mark_blind(axes, evaluation)
    panels[-1].set_xlabel("time [s]")


def _draw_true_errors(panels: Sequence[Axes], evaluation: Evaluation, comparison: Comparison) -> None:
    rotations = np.degrees([joint.rotation_errors for joint in comparison.joints.values()]).T
    for axes, errors, label in (
        (panels[0], MM_PER_M * comparison.position_errors, "position\n[mm]"),
        (panels[1], rotations, "rotation\n[°]"),
    ):
        _draw_spread(axes, broken_at_gaps(evaluation.solved, comparison.stamps_ns, errors))
        _scale_by_decades(axes, errors)
        axes.set_ylabel(label)
    panel_title(panels[0], "Error against the truth", "mean over joints, and the worst joint")


def _draw_own_doubts(panels: Sequence[Axes], evaluation: Evaluation) -> None:
    solved = evaluation.solved
    sigma = broken_at_gaps(solved, solved.stamps_ns, MM_PER_M * evaluation.position_sigma)
    panels[0].plot(*sigma, color=INK, linewidth=1.4, marker=lone_marker(sigma))
    panels[0].set_ylabel("root sigma\n[mm]")
    _draw_spread(panels[1], broken_at_gaps(solved, solved.stamps_ns, MM_PER_M * evaluation.jitter))
    panels[1].set_ylabel("jitter\n[mm]")
    for axes in panels:
        axes.set_ylim(bottom=0.0)
    panel_title(panels[0], "Uncertainty", "of the root; jitter of all segments: mean, and the worst")


def _draw_spread(axes: Axes, curves: tuple[Array, Array]) -> None:
    """The mean over the columns of values (T, J) as a line, up to their maximum an area."""
    seconds, values = curves
    mean, worst = values.mean(axis=1), values.max(axis=1)
    axes.fill_between(seconds, mean, worst, color=TRUTH, alpha=0.45, linewidth=0.0)
    axes.plot(seconds, mean, color=INK, linewidth=1.4, marker=lone_marker(curves))
    known = mean[np.isfinite(mean)]
    if len(known):
        overall = float(known.mean())
        axes.annotate(
            f"mean {overall:#.2g}", (1.0, overall), (4, 0), xycoords=("axes fraction", "data"),
            textcoords="offset points", va="center", fontsize=8.0, color=QUIET,
        )  # fmt: skip


def _scale_by_decades(axes: Axes, errors: Array) -> None:
    """A logarithmic scale: a limb that is lost is wrong by orders of magnitude more than one that is not."""
    low = max(float(errors.mean(axis=1).min()), _LEAST_ERROR) / _ROOM
    high = max(float(errors.max()), _LEAST_ERROR) * _ROOM
    axes.set_yscale("log", nonpositive="clip")
    axes.set_ylim(low, high)
    axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 3.0) if high < _SHORT_SCALE * low else (1.0,)))
    axes.yaxis.set_major_formatter("{x:g}")
    axes.yaxis.set_minor_locator(NullLocator())


def _mark_blind(axes: Axes, evaluation: Evaluation) -> None:
    solved = evaluation.solved
    half_s = 0.5e-9 * solved.frame_ns
    for second in solved.seconds(solved.stamps_ns[evaluation.blind]):
        axes.axvspan(second - half_s, second + half_s, color=WARNING, alpha=0.25, linewidth=0.0)
    for start, end in evaluation.gaps:
        axes.axvspan(start - half_s, end + half_s, color=WARNING, alpha=0.6, linewidth=0.0)
