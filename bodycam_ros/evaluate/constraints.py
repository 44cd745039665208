"""How far what equipment holds is from where it is held, in a motion with the constraint and in one without."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.errors import RecordingError
from bodycam_ros.evaluate.comparison import Comparison, compare, spread
from bodycam_ros.evaluate.true_motion import TrueMotion
from bodycam_ros.geometry import Array
from bodycam_ros.picture_style import CAUTION, INK, QUIET, light_grid, open_picture, panel_title
from bodycam_ros.results.solved_recording import SolvedRecording

_MAX_PANELS = 3


@dataclass(frozen=True, eq=False)
class HeldPoint:
    """One attachment over the T instants that both motions have.

    Attributes:
        name: of the attachment: "foot_left".
        segment: of the body that is held.
        held_at: (T, 3) where the equipment holds it [m].
        with_it: (T, 3) where the body has it in the motion with the equipment [m].
        without: (T, 3) where the motion without has it [m].
    """

    name: str
    segment: str
    held_at: Array
    with_it: Array
    without: Array

    @property
    def off_with(self) -> Array:
        """(T,) [m]."""
        off: Array = np.linalg.norm(self.with_it - self.held_at, axis=1)
        return off

    @property
    def off_without(self) -> Array:
        """(T,) [m]."""
        off: Array = np.linalg.norm(self.without - self.held_at, axis=1)
        return off


@dataclass(frozen=True, eq=False)
class WithAndWithout:
    """Two solutions of one recording.

    Attributes:
        solved: with the equipment.
        other: without.
        stamps_ns: (T,) instants that both have, and at which it is known where the equipment is [ns].
        rows, other_rows: (T,) of these instants in both.
        points: attachments, in the order of the body; those that hold feet first.
        true_with, true_without: against the truth, if that was given.
    """

    solved: SolvedRecording
    other: SolvedRecording
    stamps_ns: NDArray[np.int64]
    rows: NDArray[np.int64]
    other_rows: NDArray[np.int64]
    points: tuple[HeldPoint, ...]
    true_with: Comparison | None
    true_without: Comparison | None

    @property
    def firm(self) -> tuple[HeldPoint, ...]:
        """Attachments that hold feet, which is what pictures show; all of them where none does."""
        feet = tuple(point for point in self.points if point.segment.startswith("foot"))
        return feet or self.points


def with_and_without(
    solved: SolvedRecording, other: SolvedRecording, truth: TrueMotion | None, compared: Comparison | None
) -> WithAndWithout:
    """Put two solutions beside each other.

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
            f"{other.path}: has no instant of {solved.path} at which its equipment was placed; they span {spans[1]} "
            f"and {spans[0]}; are they of the same recording?"
        )
    rows, other_rows = rows[placed], other_rows[placed]
    points = _held_points(solved, other, rows, other_rows)
    if not points:
        raise RecordingError(f"{other.path}: has none of the segments that equipment holds in {solved.path}")
    return WithAndWithout(
        solved=solved,
        other=other,
        stamps_ns=shared[placed],
        rows=rows,
        other_rows=other_rows,
        points=points,
        true_with=compared,
        true_without=None if truth is None else compare(other, truth),
    )


def _held_points(
    solved: SolvedRecording, other: SolvedRecording, rows: NDArray[np.int64], other_rows: NDArray[np.int64]
) -> tuple[HeldPoint, ...]:
    """By the loops of the body that was published: where the equipment has them is told by the motion with it."""
    body = solved.body
    found = []
    for joint in body.loop_joints:
        ends = {joint.parent: joint.parent_T_joint, joint.child: joint.child_T_joint}
        machine, person = (
            [segment for segment in ends if (segment in body.equipment_segments) is beside] for beside in (True, False)
        )
        if len(machine) != 1 or person[0] not in other.world_T_link:
            continue
        held_at, with_it, without = (
            (of.world_T_link[segment][at] @ ends[segment])[:, :3, 3]
            for of, segment, at in (
                (solved, machine[0], rows), (solved, person[0], rows), (other, person[0], other_rows),
            )
        )  # fmt: skip
        found.append(HeldPoint(joint.name, person[0], held_at, with_it, without))
    return tuple(sorted(found, key=lambda point: not point.segment.startswith("foot")))


def constraint_figures(both: WithAndWithout) -> dict[str, Any]:
    """Figures by name, the unit at the end of the name."""
    rows: dict[str, tuple[Array, Array]] = {
        f"{point.name.replace('_', ' ')} [mm]": (1e3 * point.off_with, 1e3 * point.off_without) for point in both.points
    }
    if both.true_with is not None and both.true_without is not None:
        ours, other = both.true_with, both.true_without
        rows["joints against the truth [cm]"] = (100.0 * ours.position_errors, 100.0 * other.position_errors)
        rows["angles against the truth [deg]"] = (_angle_errors_deg(ours), _angle_errors_deg(other))
    return {
        "with": both.solved.path.name,
        "without": both.other.path.name,
        "instants": len(both.stamps_ns),
        "measures": {name: {"with": spread(a), "without": spread(b)} for name, (a, b) in rows.items()},
    }


def _angle_errors_deg(comparison: Comparison) -> Array:
    angles: Array = np.degrees(np.array([joint.angle_errors for joint in comparison.joints.values()]))
    return angles


def draw_constraints(both: WithAndWithout, path: Path) -> None:
    """Write a picture as PNG: distances from where the equipment holds points, with it and without (B figure 12).

    Raises:
        OSError: the file cannot be written.
    """
    points = both.firm[:_MAX_PANELS]
    with open_picture(path, 14.0, 3.4) as figure:
        panels = figure.subplots(1, len(points), squeeze=False)[0]
        for axes, point in zip(panels, points, strict=True):
            for off, colour, name in ((point.off_without, CAUTION, "without"), (point.off_with, INK, "with")):
                seconds, values = both.solved.curve(both.stamps_ns, 1e3 * off)
                label = f"{name}: {1e3 * float(off.mean()):.1f} mm, {1e3 * float(off.max()):.1f} at most"
                axes.plot(seconds, values, color=colour, linewidth=1.4, label=label)
            axes.set_ylim(0.0, 1.35e3 * max(1e-3, float(max(point.off_without.max(), point.off_with.max()))))
            axes.set_xlabel("time [s]")
            axes.set_ylabel("distance [mm]")
            axes.legend(loc="upper right", ncols=2, labelcolor=QUIET)
            light_grid(axes)
            panel_title(axes, point.name.replace("_", " "), "from where the equipment holds it")
        figure.subplots_adjust(left=0.05, right=0.985, top=0.86, bottom=0.15, wspace=0.18)
