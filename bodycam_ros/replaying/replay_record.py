"""What a replay knows of a recording, or of a stretch of it, beside the messages that it wrote."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

from bodycam_ros.camera.readout import Readout
from bodycam_ros.estimation.solver_counts import SolverCounts
from bodycam_ros.pipeline.skeleton import SkeletonPipeline
from bodycam_ros.quality.camera_poses import LoggedPoses
from bodycam_ros.replaying.camera_worker import UnusableImages
from bodycam_ros.timing.clock_state import ClockState


@dataclass(frozen=True)
class SolverOutcome:
    """What the solver counted.

    Attributes:
        counts: of frames and states.
        frames: frames with images.
        late: registrations that came too late for their frame.
        clocks: camera -> its clock, one more wherever it may have been set.
        remarks: on inertial sensors.
    """

    counts: SolverCounts
    frames: int
    late: int
    clocks: Mapping[str, tuple[ClockState, ...]]
    remarks: tuple[str, ...] = ()

    @classmethod
    def of(cls, skeleton: SkeletonPipeline) -> "SolverOutcome":
        """What it counted so far."""
        return cls(
            skeleton.counts,
            skeleton.arrivals.frames,
            skeleton.arrivals.late,
            {camera: history.clocks for camera, history in skeleton.clocks.histories.items()},
            tuple(skeleton.inertial.remarks()),
        )

    def since(self, before: "SolverOutcome") -> "SolverOutcome":
        """What it counted after ``before``; clocks and remarks as they are now."""
        counts = self.counts.since(before.counts)
        return SolverOutcome(counts, self.frames - before.frames, self.late - before.late, self.clocks, self.remarks)

    def followed_by(self, later: "SolverOutcome") -> "SolverOutcome":
        """What it counted of a stretch of a recording and of the one after it."""
        clocks = {name: _joined(own, later.clocks.get(name, ())) for name, own in self.clocks.items()}
        return SolverOutcome(
            self.counts + later.counts,
            self.frames + later.frames,
            self.late + later.late,
            {**later.clocks, **clocks},
            tuple(dict.fromkeys((*self.remarks, *later.remarks))),
        )


def _joined(clocks: tuple[ClockState, ...], later: tuple[ClockState, ...]) -> tuple[ClockState, ...]:
    """The clock of two stretches of a recording, which both begin with the one that the first pass found."""
    known = {(clock.offset, clock.drift) for clock in clocks}
    return (*clocks, *(clock for clock in later if (clock.offset, clock.drift) not in known))


@dataclass(frozen=True, eq=False)
class StretchRecord:
    """A stretch of a recording as it was solved.

    Attributes:
        number, count: which stretch it is, from 0 on, and how many there are.
        start_ns, latest_ns: stamps of its first and its last image [ns].
        images, registered, left_out: camera -> images read, of these registered; and those beyond ``images.max_rate``.
        solved, predicted: states, and those that no camera contributed to.
        spans_ns: camera -> stamps of its first and last image [ns].
        readouts: camera -> its own latest read-out time.
        unusable: images that could not be used, one for each camera and kind with the count of all.
        outcome: of the solver.
        poses: registered and solved poses of the cameras.
    """

    number: int
    count: int
    start_ns: int
    latest_ns: int
    images: Counter[str]
    registered: Counter[str]
    left_out: Counter[str]
    solved: int
    predicted: int
    spans_ns: Mapping[str, tuple[int, int]]
    readouts: Mapping[str, Readout]
    unusable: tuple[UnusableImages, ...]
    outcome: SolverOutcome
    poses: LoggedPoses
