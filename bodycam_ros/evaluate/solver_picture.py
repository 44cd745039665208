"""The same registrations solved in several ways, drawn as A figures 6 and 7: camera centres, angles, positions."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.drawing.picture_style import (
    CENTRE,
    GOOD,
    INK,
    LEFT,
    QUIET,
    RELATIVE,
    RIGHT,
    TRUTH,
    TYPOGRAPHY,
    light_grid,
    panel_title,
)
from bodycam_ros.evaluate.solver_comparison import MeasuredRun, SolverComparison
from bodycam_ros.evaluate.solver_errors import SolverErrors
from bodycam_ros.evaluate.solver_runs import DARK_ONE_OF, SolverRun, Way
from bodycam_ros.evaluate.true_motion import TrueMotion, read_true_camera
from bodycam_ros.geometry import Array, inverse
from bodycam_ros.solved.trajectory import interpolated

COLOURS = {Way.ALONE: RIGHT, Way.SLIDING: RELATIVE, Way.WINDOW: LEFT, Way.OFFLINE: GOOD, Way.BATCH: CENTRE}
"""The ways that are drawn: of those that wait for some frames only the one that waits longest."""

_AXES = ("forward", "left", "up")
_SHADES = (INK, LEFT, RIGHT)
_UPPER, _LOWER = ("upper_arm", "forearm"), ("thigh", "shin")
_SIZE_INCHES = (15.0, 12.5)
_DOTS_PER_INCH = 110
_CM = 100.0


def draw_solvers(
    body: BodyModel,
    truth: TrueMotion,
    compared: SolverComparison,
    path: Path,
) -> None:
    """Write the picture as PNG.

    Args:
        body: with its mounts.
        truth: of the recording.
        compared: all ways, measured against it.
        path: of the file.

    Raises:
        OSError: the file cannot be written.
    """
    as_recorded, dark = (_known(runs) for runs in (compared.as_recorded, compared.dark))
    with matplotlib.rc_context(TYPOGRAPHY):
        figure = Figure(figsize=_SIZE_INCHES, facecolor="white")
        FigureCanvasAgg(figure)
        figure.text(0.045, 0.982, f"Ways to solve {truth.recording}", fontsize=17.0, weight="bold", va="top")
        note = f"a {_share(DARK_ONE_OF)} of the cameras dark at any time, half a second each; truth in grey"
        figure.text(0.045, 0.955, note, fontsize=10.0, color=QUIET, va="top")
        panels = figure.subplots(4, 2, gridspec_kw={"height_ratios": (1.0, 1.0, 1.0, 1.25)})
        figure.subplots_adjust(left=0.06, right=0.975, top=0.9, bottom=0.05, hspace=0.42, wspace=0.14)
        camera = _camera_to_show(body, truth)
        for axes, way, letter in zip(panels[0], (Way.ALONE, Way.OFFLINE), "ab", strict=True):
            _draw_camera(axes, body, truth, camera, dark[way])
            panel_title(axes, f"Camera {camera}, {way.value}", f"from the {body.root}; as A figure 6({letter})")
        for axes, kinds, half in zip(panels[1], (_UPPER, _LOWER), ("arms", "legs"), strict=True):
            _draw_angles(axes, dark, kinds)
            panel_title(axes, f"Joint angles, {half}", "as A figure 7(a)")
        _draw_errors(panels[2, 0], {way: _CM * one.errors.positions for way, one in dark.items()}, dark)
        panel_title(panels[2, 0], "Joint positions", "error, mean of all joints [cm]; as A figure 7(b)")
        _draw_errors(panels[2, 1], {way: np.degrees(one.errors.rotations) for way, one in dark.items()}, dark)
        panel_title(panels[2, 1], "Joint rotations", "error, mean of all joints [°]")
        _draw_costs(panels[3, 0], as_recorded, dark, lambda errors: _CM * float(errors.positions.mean()))
        panel_title(panels[3, 0], "Position error and time", "filled: as recorded; open: cameras dark in turn")
        panels[3, 0].set_ylabel("mean error [cm]")
        panels[3, 0].set_ylim(0.0, 1.08 * panels[3, 0].dataLim.ymax)
        _draw_costs(panels[3, 1], as_recorded, dark, lambda errors: float(np.degrees(errors.rotations).mean()))
        panel_title(panels[3, 1], "Rotation error and time", "and memory")
        panels[3, 1].set_ylabel("mean error [°]")
        panels[3, 1].set_yscale("log")
        _plain_log(panels[3, 1].yaxis)
        panels[3, 1].legend(
            handles=_key(as_recorded, dark), loc="center right", bbox_to_anchor=(1.0, 0.42), handlelength=1.0
        )
        figure.savefig(path, dpi=_DOTS_PER_INCH, format="png")


@dataclass(frozen=True, eq=False)
class _Known:
    """A run whose errors are known."""

    run: SolverRun
    errors: SolverErrors


def _known(runs: Mapping[Way, MeasuredRun]) -> dict[Way, _Known]:
    return {way: _Known(one.run, one.errors) for way, one in runs.items() if way in COLOURS and one.errors is not None}


def _share(one_of: int) -> str:
    return {2: "half", 3: "third", 4: "quarter"}.get(one_of, f"1/{one_of}")


def _camera_to_show(body: BodyModel, truth: TrueMotion) -> str:
    """A foot's, if there is one whose truth is known: it moves most."""
    known = [camera for camera in body.mounts if (truth.path / "cameras" / f"{camera}.tum").is_file()]
    feet = [camera for camera in known if body.mounts[camera].segment.startswith("foot")]
    return (feet or known or list(body.mounts))[0]


def _draw_camera(axes: Axes, body: BodyModel, truth: TrueMotion, camera: str, one: _Known) -> None:
    errors, mount = one.errors, body.mounts[camera]
    world_T_root = truth.at(errors.stamps_ns, body.root)
    seconds = _seconds(errors)
    true_poses = read_true_camera(truth, camera)
    centres = _from(world_T_root, errors.estimated[mount.segment] @ mount.segment_T_camera)
    for axis, (name, colour) in enumerate(zip(_AXES, _SHADES, strict=True)):
        if true_poses is not None:
            at_instants = interpolated(truth.stamps_ns, true_poses, errors.stamps_ns)
            axes.plot(seconds, _from(world_T_root, at_instants)[:, axis], color=TRUTH, linewidth=4.5, alpha=0.7)
        axes.plot(seconds, centres[:, axis], color=colour, linewidth=1.2, label=name)
    axes.set_ylabel("m")
    axes.legend(ncols=3, loc="center right", bbox_to_anchor=(1.0, 0.27), borderaxespad=0.0, handlelength=1.4)
    light_grid(axes)


def _from(world_T_root: Array, world_T_camera: Array) -> Array:
    """(T, 3) centres of a camera in the root's axes [m]."""
    return np.asarray((inverse(world_T_root) @ world_T_camera)[:, :3, 3])


def _draw_angles(axes: Axes, dark: Mapping[Way, _Known], kinds: Sequence[str]) -> None:
    """The left side's joints, each instant alone and the whole recording."""
    for kind in kinds:
        for way in (Way.ALONE, Way.OFFLINE):
            errors = dark[way].errors
            segment = f"{kind}_left"
            if segment not in errors.angles:
                continue
            if way is Way.ALONE:
                axes.plot(
                    _seconds(errors), np.degrees(errors.true_angles[segment]), color=TRUTH, linewidth=4.5, alpha=0.7
                )
            style = "-" if kind == kinds[0] else (0, (4, 1.5))
            axes.plot(
                _seconds(errors),
                np.degrees(errors.angles[segment]),
                color=COLOURS[way],
                linewidth=1.2,
                linestyle=style,
                zorder=2 + (way is Way.OFFLINE),
            )
    axes.set_ylabel("°")
    handles = [
        Line2D([], [], color=INK, linestyle="-", label=kinds[0].replace("_", " ")),
        Line2D([], [], color=INK, linestyle=(0, (4, 1.5)), label=kinds[1].replace("_", " ")),
        *[Line2D([], [], color=COLOURS[way], label=way.value) for way in (Way.ALONE, Way.OFFLINE)],
    ]
    axes.legend(
        handles=handles, ncols=4, loc="lower right", bbox_to_anchor=(1.0, 1.0), columnspacing=1.0, handlelength=1.6
    )
    light_grid(axes)


def _draw_errors(axes: Axes, errors: Mapping[Way, Array], dark: Mapping[Way, _Known]) -> None:
    """The mean of all joints over time; the full batch lies on the blocks."""
    for way, of_joints in errors.items():
        if way is not Way.BATCH:
            axes.plot(_seconds(dark[way].errors), of_joints.mean(axis=1), color=COLOURS[way], linewidth=1.3)
    axes.set_ylim(bottom=0.0)
    axes.set_xlabel("time [s]")
    light_grid(axes)


def _draw_costs(
    axes: Axes,
    as_recorded: Mapping[Way, _Known],
    dark: Mapping[Way, _Known],
    measure: Callable[[SolverErrors], float],
) -> None:
    """One point for each way, and one more with cameras dark."""
    for runs, filled in ((as_recorded, True), (dark, False)):
        for way, one in runs.items():
            colour = COLOURS[way]
            axes.plot(
                float(np.median(one.run.solve_ms)),
                measure(one.errors),
                "o",
                markersize=9,
                markeredgecolor=colour,
                markerfacecolor=colour if filled else "white",
            )
    axes.set_xscale("log")
    axes.set_xlabel("CPU time of an instant, median [ms]")
    _plain_log(axes.xaxis)
    light_grid(axes)


def _key(as_recorded: Mapping[Way, _Known], dark: Mapping[Way, _Known]) -> list[Line2D]:
    """What the colours mean, and how much memory each way took."""
    most_mb = {way: max(one.run.memory_mb, dark[way].run.memory_mb) for way, one in as_recorded.items()}
    return [
        Line2D([], [], color=COLOURS[way], marker="o", linestyle="", label=f"{way.value}: {mb:.0f} MB")
        for way, mb in most_mb.items()
    ]


def _plain_log(axis: Axis) -> None:
    """A logarithm with ticks at 1, 2 and 5, written out."""
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.set_minor_locator(NullLocator())
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))


def _seconds(errors: SolverErrors) -> Array:
    return np.asarray(1e-9 * (errors.stamps_ns - errors.stamps_ns[0]).astype(np.float64))
