"""A recording solved with equipment beside the same one solved without (B figure 12).

python -m benchmarks.with_and_without OUT OUT_WITHOUT -o PNG [--truth RECORDING] prints distances from the points of the
equipment, and errors against a truth, and draws the former.
"""

import argparse
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.errors import RecordingError
from bodycam_ros.evaluate.comparison import Comparison, TrueMotion, compare, read_true_motion
from bodycam_ros.evaluate.figures import Spread, spread
from bodycam_ros.geometry import Array
from bodycam_ros.results.picture_style import CAUTION, INK, QUIET, light_grid, open_picture, panel_title
from bodycam_ros.results.solved_recording import SolvedRecording, read_solved

_MAX_PANELS = 3


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

    def measures(self) -> dict[str, tuple[Spread, Spread]]:
        """Name -> figures with the equipment, and without."""
        pairs = {
            f"{point.name.replace('_', ' ')} [mm]": (spread(point.off_with, 1e3), spread(point.off_without, 1e3))
            for point in self.points
        }
        if self.true_with is not None and self.true_without is not None:
            figures = self.true_with.figures(), self.true_without.figures()
            pairs["joints against the truth [cm]"] = figures[0].position_cm, figures[1].position_cm
            pairs["angles against the truth [deg]"] = figures[0].angle_deg, figures[1].angle_deg
        return pairs


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
            f"{solved.path}: was solved without equipment; give first the bag of 'bodycam replay --equipment', then "
            "that of the same recording solved without"
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


def main() -> None:
    """Compare, print and draw."""
    parser = argparse.ArgumentParser(prog="benchmarks.with_and_without", description=__doc__)
    parser.add_argument("solved", type=Path)
    parser.add_argument("without", type=Path)
    parser.add_argument("--truth", type=Path)
    parser.add_argument("-o", "--output", type=Path, required=True)
    arguments = parser.parse_args()
    solved, truth = read_solved(arguments.solved), arguments.truth and read_true_motion(arguments.truth)
    compared = None if truth is None else compare(solved, truth)
    both = with_and_without(solved, read_solved(arguments.without), truth, compared)
    for name, (ours, theirs) in both.measures().items():
        print(f"{name}: with {ours.mean:.2f}, {ours.max:.2f} at most", end="; ")
        print(f"without {theirs.mean:.2f}, {theirs.max:.2f} at most")
    draw_constraints(both, arguments.output)


if __name__ == "__main__":
    main()
