"""How far what equipment holds is from where it is held, in a motion with the constraint and in one without."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from bodycam_ros.body.urdf_reader import body_from_urdf
from bodycam_ros.errors import RecordingError
from bodycam_ros.evaluate.comparison import Comparison, compare
from bodycam_ros.evaluate.space_axes import frame_space
from bodycam_ros.evaluate.true_motion import TrueMotion
from bodycam_ros.geometry import Array
from bodycam_ros.plots.picture_style import EQUIPMENT, QUIET, TYPOGRAPHY, side_colour
from bodycam_ros.recording.bag_file import BagFile
from bodycam_ros.results.solved_recording import SolvedRecording
from bodycam_ros.results.topics import published_robot


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
    with BagFile(solved.path) as bag:
        body = body_from_urdf(published_robot(bag))
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


_SIZE_INCHES = (14.0, 7.0)
_DOTS_PER_INCH = 110
_TURN_DEG = 55.0


def draw_ways_with_and_without(both: WithAndWithout, path: Path) -> None:
    """Write the picture as PNG: ways of held points in colour, of what holds them beneath.

    Raises:
        OSError: the file cannot be written.
    """
    points = both.firm
    every = 1e3 * np.concatenate([way for point in points for way in (point.held_at, point.with_it, point.without)])
    heading = both.solved.motion.world_T_root[:, :2, 0].mean(axis=0)
    ahead_deg = float(np.degrees(np.arctan2(heading[1], heading[0])))
    with matplotlib.rc_context(TYPOGRAPHY):
        figure = Figure(figsize=_SIZE_INCHES, facecolor="white")
        FigureCanvasAgg(figure)
        for number, (name, whose) in enumerate((("with", "with_it"), ("without", "without"))):
            axes: Any = figure.add_axes((0.02 + 0.49 * number, 0.0, 0.46, 0.95), projection="3d")
            frame_space(axes, every, ahead_deg - _TURN_DEG)
            for point in points:
                axes.plot(*(1e3 * point.held_at).T, color=EQUIPMENT, linewidth=3.0, alpha=0.35)
                axes.plot(*(1e3 * getattr(point, whose)).T, color=side_colour(point.segment), linewidth=1.3)
            off = 1e3 * np.array([np.linalg.norm(getattr(point, whose) - point.held_at, axis=1) for point in points])
            figure.text(0.03 + 0.49 * number, 0.95, name, fontsize=12.0, weight="bold")
            note = f"{off.mean():.1f} mm from where the equipment holds them on average, {off.max():.1f} mm at most"
            figure.text(0.03 + 0.49 * number, 0.92, note, color=QUIET)
        sides = {point.segment: side_colour(point.segment) for point in points}
        handles = [Line2D([], [], color=colour, label=name.replace("_", " ")) for name, colour in sides.items()]
        handles.append(Line2D([], [], color=EQUIPMENT, linewidth=3.0, alpha=0.35, label="what holds them"))
        figure.legend(handles=handles, loc="lower center", ncols=len(handles))
        figure.savefig(path, dpi=_DOTS_PER_INCH, format="png")
