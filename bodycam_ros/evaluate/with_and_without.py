"""A recording solved with equipment beside the same one solved without (B figures 9, 10 and 12)."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from mpl_toolkits.mplot3d.axes3d import Axes3D
from numpy.typing import NDArray

from bodycam_ros.errors import RecordingError
from bodycam_ros.evaluate.comparison import Comparison, TrueMotion, compare
from bodycam_ros.evaluate.figures import TwoSpreads, spread
from bodycam_ros.geometry import Array
from bodycam_ros.results.colours import CAUTION, INK, QUIET
from bodycam_ros.results.picture_style import light_grid, open_picture, panel_title
from bodycam_ros.results.solved_recording import SolvedRecording

_MAX_PANELS = 3
_TICKS = 6  # of the longest axis in space


@dataclass(frozen=True, eq=False)
class ConstrainedPoint:
    """One attachment over the T states of two motions.

    Attributes:
        name: of the attachment: "foot_left".
        segment: of the body.
        with_it, without: (T, 3) point of the person that is attached [m], with the equipment and without.
        equipment: (T, 3) the point of the equipment that it is attached to [m].
    """

    name: str
    segment: str
    with_it: Array
    without: Array
    equipment: Array

    @property
    def off_with(self) -> Array:
        """(T,) distance from the equipment's point [m], with the equipment."""
        return _distance(self.with_it, self.equipment)

    @property
    def off_without(self) -> Array:
        """(T,) distance from the equipment's point [m], without the equipment."""
        return _distance(self.without, self.equipment)


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

    def figures(self) -> dict[str, TwoSpreads]:
        """Measure -> figures with the equipment, and without."""
        found = {
            f"{point.name.replace('_', ' ')} [mm]": TwoSpreads(
                spread(point.off_with, 1e3), spread(point.off_without, 1e3)
            )
            for point in self.points
        }
        if self.true_with is not None and self.true_without is not None:
            ours, theirs = self.true_with.figures(), self.true_without.figures()
            found["joints against the truth [cm]"] = TwoSpreads(ours.position_cm, theirs.position_cm)
            found["angles against the truth [deg]"] = TwoSpreads(ours.angle_deg, theirs.angle_deg)
        return found


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
            f"{spans[0]}; check that they are of the same recording"
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
            points.append(ConstrainedPoint(joint.name, person[0], with_it, without, on_machine))
    if not points:
        raise RecordingError(f"{other.path}: has none of the segments that equipment constrains in {solved.path}")
    points.sort(key=lambda point: not point.segment.startswith("foot"))
    true_without = None if truth is None else compare(other, truth)
    return WithAndWithout(solved, other, shared[placed], tuple(points), compared, true_without)


def _distance(here: Array, there: Array) -> Array:
    distance: Array = np.linalg.norm(here - there, axis=1)
    return distance


def draw_constraints(both: WithAndWithout, path: Path) -> None:
    """Write a picture as PNG, with the equipment and without: distances from its points (B figure 12), paths (B 10).

    Raises:
        OSError: the file cannot be written.
    """
    feet = [point for point in both.points if point.segment.startswith("foot")]
    points = (feet or both.points)[:_MAX_PANELS]
    with open_picture(path, 14.0, 8.6) as figure:
        grid = figure.add_gridspec(2, len(points), height_ratios=(3.2, 5.4))
        for column, point in enumerate(points):
            axes = figure.add_subplot(grid[0, column])
            for off, colour, name in ((point.off_without, CAUTION, "without"), (point.off_with, INK, "with")):
                curve = both.solved.curve(both.stamps_ns, 1e3 * off)
                label = f"{name}: mean {1e3 * float(off.mean()):.1f} mm, at most {1e3 * float(off.max()):.1f}"
                axes.plot(*curve, color=colour, linewidth=1.4, label=label)
            axes.set_ylim(0.0, 1.35e3 * max(1e-3, float(max(point.off_without.max(), point.off_with.max()))))
            axes.set_xlabel("time [s]")
            axes.set_ylabel("distance [mm]")
            axes.legend(loc="upper right", ncols=2, labelcolor=QUIET)
            light_grid(axes)
            panel_title(axes, point.name.replace("_", " "), "distance from its point on the equipment")
            _draw_paths(figure.add_subplot(grid[1, column], projection="3d"), point)
        figure.subplots_adjust(left=0.05, right=0.97, top=0.93, bottom=0.05, wspace=0.18, hspace=0.18)


def _draw_paths(axes: Axes3D, point: ConstrainedPoint) -> None:
    """The paths of an attached point in space: a pedal's is a circle (B figure 10)."""
    middle = np.nanmean(point.equipment, axis=0)
    for positions, colour, width in ((point.without, CAUTION, 1.0), (point.with_it, INK, 1.4)):
        axes.plot(*(1e3 * (positions - middle)).T, color=colour, linewidth=width)
    axes.set_aspect("equal")
    extents = np.ptp(point.equipment, axis=0)
    for axis, extent in zip("xyz", extents.tolist(), strict=True):
        # A short axis has no room for numbers.
        axes.locator_params(axis=axis, nbins=max(1, round(_TICKS * extent / max(1e-9, float(extents.max())))))
    axes.set_xlabel("x [mm]")
    axes.set_ylabel("y [mm]")
    axes.set_zlabel("z [mm]")
    axes.set_title("path in space, from the middle of the equipment's point", color=QUIET, fontsize=9.0)
