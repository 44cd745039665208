"""Panels over time: errors or, without truth, the uncertainty; errors of each joint; residuals of gyroscopes."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import LogLocator, NullLocator

from bodycam_ros.body.segment_name import JOINT_ABOVE, SegmentName
from bodycam_ros.evaluate.camera_figures import GyroscopeResiduals
from bodycam_ros.evaluate.evaluation import Evaluation
from bodycam_ros.geometry import Array
from bodycam_ros.results import colours
from bodycam_ros.results import picture_style as style

ERROR_PANELS = 2
_ROOM = 1.3  # beyond the least and the greatest value, as a factor
_MIN_ERROR = 1e-3  # [mm] and [deg] lower end of a logarithmic scale
_ROWS = (("spine", "neck", "shoulder", "elbow"), ("hip", "knee", "ankle", "pelvis"))
_WIDTH, _ROW_HEIGHT = 16.0, 2.4  # [in]


def draw_errors(panels: Sequence[Axes], evaluation: Evaluation) -> None:
    """Draw two panels, of position and of rotation or without truth of noise; frames without measurement in red."""
    solved, comparison = evaluation.solved, evaluation.comparison
    if comparison is not None:
        rotations = np.degrees([*comparison.rotation_errors.values()]).T
        for axes, errors in zip(panels, (1e3 * comparison.position_errors, rotations), strict=True):
            _draw_spread(axes, solved.curve(comparison.stamps_ns, errors))
            if errors.max() > 0.0:  # errors of a lost limb are larger by orders of magnitude
                axes.set_yscale("log", nonpositive="clip")
                least, most = float(errors.mean(axis=1).min()), float(errors.max())
                axes.set_ylim(max(least / _ROOM, _MIN_ERROR), max(most * _ROOM, 2.0 * _MIN_ERROR))
                axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0), numticks=5))
                axes.yaxis.set_major_formatter("{x:g}")
                axes.yaxis.set_minor_locator(NullLocator())
        labels = ("position\nerror [mm]", "rotation\nerror [°]")
        title = "Error against the truth"
        note = "of joints"
    else:
        _draw_spread(panels[0], solved.curve(solved.stamps_ns, 1e3 * evaluation.position_sigma[:, None]))
        _draw_spread(panels[1], solved.curve(solved.stamps_ns, 1e3 * evaluation.jitter))
        labels = ("root sigma\n[mm]", "jitter\n[mm]")
        title = "Uncertainty"
        note = "of the root; jitter of segments"
        for axes in panels:
            axes.set_ylim(bottom=0.0)
    style.panel_title(panels[0], title, note)
    half_s = 0.5e-9 * solved.frame_ns
    for axes, label in zip(panels, labels, strict=True):
        axes.set_ylabel(label)
        style.light_grid(axes)
        for second in solved.seconds(solved.stamps_ns[evaluation.blind]):
            axes.axvspan(second - half_s, second + half_s, color=colours.WARNING, alpha=0.25, linewidth=0.0)
        for start, end in evaluation.figures.gaps_s:
            axes.axvspan(start - half_s, end + half_s, color=colours.WARNING, alpha=0.6, linewidth=0.0)
    panels[-1].set_xlabel("time [s]")
    key: list[Line2D | Patch] = [Line2D([], [], color=colours.INK, label="mean")]
    key += [Patch(color=colours.TRUTH, alpha=0.45, label="up to the worst")]
    if evaluation.blind.any() or evaluation.figures.gaps_s:
        key.append(Patch(color=colours.WARNING, alpha=0.4, label="no camera registered, or not solved"))
    panels[0].legend(
        handles=key, loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=len(key), borderaxespad=0.0, handlelength=1.6
    )


def _draw_spread(axes: Axes, curves: tuple[Array, Array]) -> None:
    """The mean over the columns of values (T, J) as a line, up to their maximum an area."""
    seconds, values = curves
    mean, worst = values.mean(axis=1), values.max(axis=1)
    axes.fill_between(seconds, mean, worst, color=colours.TRUTH, alpha=0.45, linewidth=0.0)
    # One point shows as a dot: it makes no line.
    axes.plot(seconds, mean, color=colours.INK, linewidth=1.4, marker="o" if len(seconds) == 1 else "")
    if np.isfinite(mean).any():
        overall = float(np.nanmean(mean))
        axes.annotate(
            f"mean {overall:#.2g}".rstrip("."), (1.0, overall), (4, 0), xycoords=("axes fraction", "data"),
            textcoords="offset points", va="center", fontsize=8.0, color=colours.QUIET,
        )  # fmt: skip


def draw_joint_errors(evaluation: Evaluation, path: Path) -> None:
    """Write the picture as PNG: a panel for each kind of joint, left and right in their colours.

    Rotations are geodesic against a truth, angles since the first frame (A figure 7a) against another system.

    Raises:
        OSError: the file cannot be written.
    """
    if (comparison := evaluation.comparison) is not None:
        stamps_ns, turns = comparison.stamps_ns, comparison.rotation_errors
        positions = dict(zip(comparison.segments, comparison.position_errors.T, strict=True))
    else:
        assert (agreement := evaluation.agreement) is not None
        stamps_ns, turns = agreement.stamps_ns, agreement.angle_errors
        positions = {point.link: point.errors for point in reversed(agreement.joints)}
    kinds_of_errors = (positions, 100.0, "position error [cm]"), (turns, float(np.degrees(1.0)), "rotation error [°]")
    rows = [(*kind, joints) for kind in kinds_of_errors if kind[0] for joints in _ROWS]
    height = _ROW_HEIGHT * len(rows) + 0.4
    with style.open_picture(path, _WIDTH, height) as figure:
        panels = figure.subplots(len(rows), 4, sharex=True, squeeze=False)
        for row, (errors, factor, label, kinds) in zip(panels, rows, strict=True):
            for axes, kind in zip(row, kinds, strict=True):
                below = next((segment for segment, joint in JOINT_ABOVE.items() if joint == kind), kind)
                here = {segment: factor * e for segment, e in errors.items() if SegmentName(segment).kind == below}
                _draw_panel(axes, kind, {s: evaluation.solved.curve(stamps_ns, e) for s, e in here.items()})
            row[0].set_ylabel(label)
        for axes in panels[-1]:
            axes.set_xlabel("time [s]")
        sides = (("left", colours.LEFT), ("right", colours.RIGHT), ("trunk", colours.CENTRE))
        figure.legend(handles=[Line2D([], [], color=c, label=name) for name, c in sides], loc="lower center", ncols=3)
        figure.align_ylabels()
        figure.subplots_adjust(
            left=0.05, right=0.985, bottom=0.75 / height, top=1.0 - 0.4 / height, wspace=0.16, hspace=0.34
        )


def _draw_panel(axes: Axes, kind: str, curves: Mapping[str, tuple[Array, Array]]) -> None:
    for segment, curve in curves.items():
        axes.plot(*curve, color=colours.side_colour(segment), linewidth=1.2)
    values = np.concatenate([np.zeros(0), *(values for _, values in curves.values())])
    known = values[np.isfinite(values)]
    if not known.size:
        axes.axis("off")
        return
    style.panel_title(axes, kind, f"mean {known.mean():.2f}")
    axes.set_ylim(0.0, 1.1 * float(known.max()) + 1e-6)
    style.light_grid(axes)


_STRIP_WIDTH, _STRIP_ROW, _STRIP_MARGINS = 10.0, 0.28, 0.85  # [in]
_STRIP_COLUMN_S = 0.2  # of a cell, at least; several states, so that one image does not decide
_MAX_COLUMNS = 300
_LEAST, _MOST = 0.3, 30.0  # [deg/s] ends of the scale: noise of the solved turn from image to image, and a sensor off


def draw_sensors(residuals: Mapping[str, GyroscopeResiduals], path: Path) -> None:
    """Write a picture with a row for each camera: medians of its residual [deg/s], darker the larger."""
    end_s = max(float(each.seconds.max()) for each in residuals.values())
    edges = np.linspace(0.0, end_s, int(np.clip(end_s / _STRIP_COLUMN_S, 1, _MAX_COLUMNS)) + 1)
    table = np.full((len(residuals), len(edges) - 1), np.nan)
    for row, each in enumerate(residuals.values()):
        size, column = np.degrees(np.linalg.norm(each.rad_s, axis=1)), np.digitize(each.seconds, edges[1:-1])
        for cell in np.unique(column).tolist():
            table[row, cell] = np.median(size[column == cell])
    with style.open_picture(path, _STRIP_WIDTH, _STRIP_MARGINS + _STRIP_ROW * len(residuals)) as figure:
        axes = figure.add_axes(
            (0.13, 0.45 / figure.get_figheight(), 0.85, 1.0 - _STRIP_MARGINS / figure.get_figheight())
        )
        extent = (0.0, end_s, len(residuals) - 0.5, -0.5)
        image = axes.imshow(
            np.clip(table, _LEAST, _MOST), cmap=style.LANDMARKS, norm=LogNorm(_LEAST, _MOST), extent=extent,
            aspect="auto", interpolation="nearest",
        )  # fmt: skip
        style.name_rows(axes, [*residuals])
        axes.set_xlabel("time [s]")
        style.panel_title(axes, "Gyroscopes against the solved cameras", "difference of angular velocities, deg/s")
        bar = figure.colorbar(image, ax=axes, pad=0.02, ticks=[_LEAST, 1.0, 3.0, 10.0, _MOST])
        bar.ax.set_yticklabels(["0.3", "1", "3", "10", "30"])
        bar.outline.set_visible(False)
