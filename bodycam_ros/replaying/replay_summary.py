"""What came of a replay, in figures and remarks."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field

from bodycam_ros.body.equipment_report import EquipmentRecord
from bodycam_ros.camera.readout import Readout
from bodycam_ros.quality.causes import WELL_REGISTERED
from bodycam_ros.replaying.extend import ExtensionRound
from bodycam_ros.results.verdict import Verdict
from bodycam_ros.timing.clock_state import ClockHistory


@dataclass
class ReplaySummary:
    """What came of a replay.

    Attributes:
        recorded_s: duration of the recording.
        start_ns: of the first image [ns].
        elapsed_s: time that the replay took [s]; 0 where stretches were solved before, each for itself.
        frames: frames with at least one image, and those interpolated.
        solved: frames with a body state.
        predicted: of these, frames that no camera contributed to.
        interpolated: frames at which all cameras were silent, filled in from both sides.
        rejected: camera -> frames at which it contradicted the others and was rejected.
        late: registrations that came too late for their frame, because a camera had been silent for long.
        images: camera -> images read.
        registered: camera -> images registered in the map.
        skipped: camera -> images that could not be used.
        lost: camera -> images that the recording counts, but that are not in it; not among ``images``.
        left_out: camera -> images beyond ``images.max_rate``; not among ``images``.
        readouts: camera -> how long its rows are read out, as far as is known in the end.
        remarks: what a person should know of a camera's stamps, rows and images, a line each.
        notes: what a person may want to know of the inputs, a line each.
        timings: camera -> how its clock went, as its stamps were corrected.
        speeds: camera -> how fast it moved while it was registered, median [rad/s, m/s].
        verdict: whether the result may be used.
        equipment: how the body was coupled to it; None without.
        rounds: by which the map was extended before.
        preview: what is solved, where that is a preview; else empty.
        clock_sigma_s: standard deviation of the least known clock, by an ingest [s]; 0 without one.
    """

    recorded_s: float
    start_ns: int = 0
    elapsed_s: float = 0.0
    frames: int = 0
    solved: int = 0
    predicted: int = 0
    interpolated: int = 0
    rejected: Counter[str] = field(default_factory=Counter)
    images: Counter[str] = field(default_factory=Counter)
    late: int = 0
    registered: Counter[str] = field(default_factory=Counter)
    skipped: Counter[str] = field(default_factory=Counter)
    lost: Counter[str] = field(default_factory=Counter)
    left_out: Counter[str] = field(default_factory=Counter)
    readouts: Mapping[str, Readout] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    timings: Mapping[str, ClockHistory] = field(default_factory=dict)
    speeds: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    verdict: Verdict = field(default_factory=lambda: Verdict.from_findings(()))
    equipment: EquipmentRecord | None = None
    rounds: tuple[ExtensionRound, ...] = ()
    preview: str = ""
    clock_sigma_s: float = 0.0

    @property
    def doubted_cameras(self) -> tuple[str, ...]:
        """Cameras that were registered so seldom, or contradict so much, that their lens may be another's."""
        accused = {finding.subject for finding in self.verdict.findings if finding.part == "camera"}
        return tuple(
            camera
            for camera, images in sorted(self.images.items())
            if camera in accused or self.registered[camera] < WELL_REGISTERED * images
        )

    @property
    def real_time_factor(self) -> float:
        """Seconds of recording per second of work."""
        return self.recorded_s / self.elapsed_s if self.elapsed_s else 0.0
