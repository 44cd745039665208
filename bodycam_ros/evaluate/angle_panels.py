"""The picture of joint angles, left and right in one panel: over the gait cycle, or over time where nobody walks."""

import math
from collections.abc import Mapping
from pathlib import Path

from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from bodycam_ros.evaluate.anatomical_angles import LEG_JOINTS, flexion_angles
from bodycam_ros.evaluate.figures import CycleFigures
from bodycam_ros.evaluate.gait import MIN_STRIDES_OF_SIDE, SIDES, Stride
from bodycam_ros.evaluate.gait_cycle import CYCLE_PERCENT, CycleAngle, cycle_angles
from bodycam_ros.evaluate.normal_angles import NormalAngles
from bodycam_ros.geometry import Array
from bodycam_ros.results import colours
from bodycam_ros.results import picture_style as style
from bodycam_ros.results.solved_recording import SolvedRecording

_JOINTS = (*LEG_JOINTS, "shoulder", "elbow")
_WIDTH, _HEIGHT = 5.0, 3.2  # [in] of a panel
_SIDE_COLOURS = {"left": colours.LEFT, "right": colours.RIGHT}
_BAND_ALPHA = 0.2
_NORMAL = colours.FAINT
_LABELS = {"ankle": "dorsiflexion [deg]"}


def solved_angles(solved: SolvedRecording) -> dict[tuple[str, str], Array]:
    """(joint, side) -> flexion (T,) [deg] of the solved body."""
    return flexion_angles({segment: solved.world_T_link[segment] for segment in solved.body_segments})


def solved_cycles(solved: SolvedRecording, strides: tuple[Stride, ...]) -> dict[tuple[str, str], CycleAngle]:
    """(joint, side) -> its angle over the strides of the solved body; empty without strides."""
    angles = {key: angle for key, angle in solved_angles(solved).items() if key[0] in LEG_JOINTS}
    return cycle_angles(solved.seconds(solved.stamps_ns), angles, strides)


def cycle_figures(cycles: Mapping[tuple[str, str], CycleAngle]) -> dict[str, CycleFigures]:
    """The figures of joints over the gait cycle, by "knee, left"."""
    return {
        f"{joint}, {side}": CycleFigures(
            each.strides,
            *each.peak,
            *each.trough,
            sd_deg=float(each.sd.mean()) if each.strides >= MIN_STRIDES_OF_SIDE else math.nan,
            mean_deg=each.mean.round(2).tolist(),
        )
        for (joint, side), each in cycles.items()
    }


def draw_angles(
    solved: SolvedRecording,
    cycles: Mapping[tuple[str, str], CycleAngle],
    path: Path,
    normal: NormalAngles | None = None,
) -> bool:
    """Write the picture as PNG; False, and no picture, of a body without any of the joints.

    Args:
        solved: the body.
        cycles: (joint, side) -> its angle over the gait cycle; without any, the angles are drawn over time.
        path: to write to.
        normal: drawn behind the gait cycles.

    Raises:
        OSError: the file cannot be written.
    """
    angles = solved_angles(solved)
    bands = normal.joints if normal is not None and cycles else {}
    joints = [joint for joint in _JOINTS if any((joint, side) in (cycles or angles) for side in SIDES)]
    if not joints:
        return False
    columns = min(3, len(joints))
    rows = -(-len(joints) // columns)
    width, height = max(2, columns) * _WIDTH, rows * _HEIGHT + 0.5
    with style.open_picture(path, width, height) as figure:
        panels = figure.subplots(rows, columns, squeeze=False).flat
        for axes, joint in zip(panels, [*joints, *[""] * (rows * columns - len(joints))], strict=True):
            if not joint:
                axes.axis("off")
                continue
            if band := bands.get(joint):
                low, high = band.mean - band.sd, band.mean + band.sd
                axes.fill_between(CYCLE_PERCENT, low, high, color=_NORMAL, linewidth=0.0, zorder=0.5)
            for side, colour in _SIDE_COLOURS.items():
                if cycle := cycles.get((joint, side)):
                    axes.plot(CYCLE_PERCENT, cycle.mean, color=colour, linewidth=1.6)
                    if cycle.strides >= MIN_STRIDES_OF_SIDE:
                        low, high = cycle.mean - cycle.sd, cycle.mean + cycle.sd
                        axes.fill_between(CYCLE_PERCENT, low, high, color=colour, alpha=_BAND_ALPHA, linewidth=0.0)
                elif not cycles and (joint, side) in angles:
                    axes.plot(*solved.curve(solved.stamps_ns, angles[joint, side]), color=colour, linewidth=1.2)
            counts = [f"{cycles[joint, side].strides} {side}" for side in SIDES if (joint, side) in cycles]
            style.panel_title(axes, joint, f"strides: {', '.join(counts)}" if counts else "over time")
            axes.axhline(0.0, color=colours.QUIET, linewidth=0.6)
            axes.set_xlabel("gait cycle [%]" if cycles else "time [s]")
            axes.set_ylabel(_LABELS.get(joint, "flexion [deg]"))
            if cycles:
                axes.set_xlim(0.0, 100.0)
            style.light_grid(axes)
        handles: list[Line2D | Patch] = [Line2D([], [], color=c, label=side) for side, c in _SIDE_COLOURS.items()]
        if any(cycle.strides >= MIN_STRIDES_OF_SIDE for cycle in cycles.values()):
            handles.append(Patch(color=colours.QUIET, alpha=_BAND_ALPHA, label="± one standard deviation over strides"))
        if normal is not None and bands:
            handles.append(Patch(color=_NORMAL, label=f"normal ± one standard deviation ({normal.name})"))
        figure.legend(handles=handles, loc="lower center", ncols=len(handles))
        figure.subplots_adjust(
            left=0.7 / width, right=1.0 - 0.2 / width, bottom=0.85 / height, top=1.0 - 0.4 / height, wspace=0.2,
            hspace=0.5,
        )  # fmt: skip
    return True
