"""Equipment in figures and pictures: how well a body was coupled to it, and the same recording solved without it."""

from dataclasses import dataclass
from itertools import cycle
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from bodycam_ros.body.equipment_report import EquipmentRecord
from bodycam_ros.calibration.anthropometry import SegmentName
from bodycam_ros.errors import RecordingError
from bodycam_ros.evaluate.comparison import Comparison, compare, spread
from bodycam_ros.evaluate.true_motion import TrueMotion
from bodycam_ros.geometry import Array
from bodycam_ros.picture_style import CAUTION, INK, QUIET, light_grid, open_picture, panel_title, side_colour
from bodycam_ros.results.solved_recording import SolvedRecording

_MAX_PANELS = 3
_MIN_GAP_MM = 0.1  # lower end of the logarithmic scale; cameras measure no less
_DASHES: tuple[tuple[int, tuple[int, ...]], ...] = ((0, ()), (0, (6, 2)), (0, (3, 1, 1, 1)), (0, (1, 1)))
"""Of attachments, by name without the side."""


def equipment_figures(record: EquipmentRecord, start_ns: int) -> dict[str, Any]:
    """Figures by name, the unit at the end of the name.

    Per attachment: the share of the states at which it was active, the distances of its points while it was and while
    it was not, and the stretches of time at which it was released although the equipment was placed [s since the
    start]. Per length that the file leaves open: its last estimate.

    Args:
        record: of a solved recording.
        start_ns: of the recording [ns].
    """
    attachments = {}
    for column, name in enumerate(record.attachments):
        held, deviations = record.held[:, column], record.deviations[:, column]
        attachments[name] = {
            "held": float(held.mean()),
            "deviation_mm": spread(deviations[held], 1e3),
            "apart_mm": spread(deviations[~held & record.placed], 1e3),
            "let_go_s": [[1e-9 * (stamp - start_ns) for stamp in stretch] for stretch in record.let_go(column)],
        }
    lengths = zip(record.lengths, (1e3 * record.values).tolist(), (1e3 * record.sigmas).tolist(), strict=True)
    placed = record.stamps_ns[record.placed]
    return {
        "name": record.name,
        "placed": float(np.mean(record.placed)),
        "placed_from_s": 1e-9 * float(placed[0] - start_ns) if placed.size else None,
        "attachments": attachments,
        "lengths": {name: {"value_mm": value, "sigma_mm": sigma} for name, value, sigma in lengths},
    }


def draw_equipment(axes: Axes, solved: SolvedRecording, record: EquipmentRecord) -> None:
    """Draw the distance of each attachment's points over time (B figure 12), thin and faint while it was released."""
    panel_title(axes, f"Distance from {record.name}", "between points that should coincide; faint: released")
    dashes = dict(zip(dict.fromkeys(SegmentName(name).kind for name in record.attachments), cycle(_DASHES)))
    distances = np.maximum(1e3 * record.deviations, _MIN_GAP_MM)
    handles = []
    for name, distance, held in zip(record.attachments, distances.T, record.held.T, strict=True):
        style: Any = {"color": side_colour(name), "linestyle": dashes[SegmentName(name).kind]}
        for mask, width, alpha in ((held, 1.5, 1.0), (~held, 0.8, 0.45)):
            # A step longer at the beginning of each stretch, so that lines meet.
            shown = mask | np.append(mask[1:], False)
            curve = solved.curve(record.stamps_ns, np.where(shown, distance, np.nan))
            axes.plot(*curve, linewidth=width, alpha=alpha, **style)
        handles.append(Line2D([], [], label=name, linewidth=1.5, **style))
    high = float(np.nanmax(distances, initial=10.0 * _MIN_GAP_MM))
    axes.set_yscale("log")
    axes.set_ylim(float(np.nanmin(distances, initial=high / 10.0)) / 1.5, high * 1.5)
    axes.yaxis.set_major_formatter("{x:g}")
    axes.set_ylabel("distance [mm]")
    axes.set_xlabel("time [s]")
    if not record.placed.any():
        axes.text(0.5, 0.5, "its pose was never known", transform=axes.transAxes, ha="center", color=QUIET)
    axes.legend(handles=handles, loc="lower right", bbox_to_anchor=(1.0, 0.98), ncols=len(handles), borderaxespad=0)
    light_grid(axes)


@dataclass(frozen=True, eq=False)
class ConstrainedPoint:
    """One attachment over the T states of two motions.

    Attributes:
        name: of the attachment: "foot_left".
        segment: of the body.
        off_with, off_without: (T,) distance [m] from the equipment's point, with the equipment and without.
    """

    name: str
    segment: str
    off_with: Array
    off_without: Array


@dataclass(frozen=True, eq=False)
class WithAndWithout:
    """Two solutions of one recording.

    Attributes:
        solved, other: with the equipment, and without.
        stamps_ns: (T,) states of both, at which the pose of the equipment is known [ns].
        points: attachments of the body, those of feet first.
        true_with, true_without: against the truth, if that was given.
    """

    solved: SolvedRecording
    other: SolvedRecording
    stamps_ns: NDArray[np.int64]
    points: tuple[ConstrainedPoint, ...]
    true_with: Comparison | None
    true_without: Comparison | None

    def figures(self) -> dict[str, Any]:
        """Figures by name."""
        pairs = {
            f"{point.name.replace('_', ' ')} [mm]": (spread(point.off_with, 1e3), spread(point.off_without, 1e3))
            for point in self.points
        }
        if self.true_with is not None and self.true_without is not None:
            figures = self.true_with.figures(), self.true_without.figures()
            pairs["joints against the truth [cm]"] = figures[0]["position_cm"], figures[1]["position_cm"]
            pairs["angles against the truth [deg]"] = figures[0]["angle_deg"], figures[1]["angle_deg"]
        return {
            "with": self.solved.path.name,
            "without": self.other.path.name,
            "instants": len(self.stamps_ns),
            "measures": {name: {"with": ours, "without": theirs} for name, (ours, theirs) in pairs.items()},
        }


def with_and_without(
    solved: SolvedRecording, other: SolvedRecording, truth: TrueMotion | None, compared: Comparison | None
) -> WithAndWithout:
    """Compare a solution with equipment with one without.

    Args:
        solved: with equipment.
        other: of the same recording, in the same world, without.
        truth: if there is one.
        compared: ``solved`` with it.

    Raises:
        RecordingError: the first has no equipment, or the two are not of one recording.
    """
    if solved.equipment is None:
        raise RecordingError(
            f"{solved.path}: was solved without equipment, so --compare has nothing to show; give OUT as solved with "
            "'bodycam replay --equipment', and with --compare the same recording solved without"
        )
    shared, rows, other_rows = np.intersect1d(solved.stamps_ns, other.stamps_ns, return_indices=True)
    placed = solved.placed[rows]
    if not placed.any():
        spans = [f"{1e-9 * s[0]:.3f} to {1e-9 * s[-1]:.3f} s" for s in (solved.stamps_ns, other.stamps_ns)]
        raise RecordingError(
            f"{other.path}: has no state of {solved.path} at which its equipment was placed; they span {spans[1]} and "
            f"{spans[0]}; are they of the same recording?"
        )
    rows, other_rows = rows[placed], other_rows[placed]
    points = []
    for joint in solved.body.loop_joints:
        ends = {joint.parent: joint.parent_T_joint, joint.child: joint.child_T_joint}
        machine = [segment for segment in ends if segment in solved.body.equipment_segments]
        person = [segment for segment in ends if segment not in solved.body.equipment_segments]
        if len(machine) == 1 and person[0] in other.world_T_link:
            on_machine, with_it, without = (
                (motion.world_T_link[segment][at] @ ends[segment])[:, :3, 3]
                for motion, segment, at in (
                    (solved, machine[0], rows), (solved, person[0], rows), (other, person[0], other_rows),
                )
            )  # fmt: skip
            off = (np.linalg.norm(body - on_machine, axis=1) for body in (with_it, without))
            points.append(ConstrainedPoint(joint.name, person[0], *off))
    if not points:
        raise RecordingError(f"{other.path}: has none of the segments that equipment constrains in {solved.path}")
    points.sort(key=lambda point: not point.segment.startswith("foot"))
    true_without = None if truth is None else compare(other, truth)
    return WithAndWithout(solved, other, shared[placed], tuple(points), compared, true_without)


def draw_constraints(both: WithAndWithout, path: Path) -> None:
    """Write a picture as PNG: distances from the equipment's points, with it and without (B figure 12).

    Raises:
        OSError: the file cannot be written.
    """
    feet = [point for point in both.points if point.segment.startswith("foot")]
    points = (feet or both.points)[:_MAX_PANELS]
    with open_picture(path, 14.0, 3.4) as figure:
        for axes, point in zip(figure.subplots(1, len(points), squeeze=False)[0], points, strict=True):
            for off, colour, name in ((point.off_without, CAUTION, "without"), (point.off_with, INK, "with")):
                curve = both.solved.curve(both.stamps_ns, 1e3 * off)
                label = f"{name}: {1e3 * float(off.mean()):.1f} mm, {1e3 * float(off.max()):.1f} at most"
                axes.plot(*curve, color=colour, linewidth=1.4, label=label)
            axes.set_ylim(0.0, 1.35e3 * max(1e-3, float(max(point.off_without.max(), point.off_with.max()))))
            axes.set_xlabel("time [s]")
            axes.set_ylabel("distance [mm]")
            axes.legend(loc="upper right", ncols=2, labelcolor=QUIET)
            light_grid(axes)
            panel_title(axes, point.name.replace("_", " "), "from its point on the equipment")
        figure.subplots_adjust(left=0.05, right=0.985, top=0.86, bottom=0.15, wspace=0.18)
