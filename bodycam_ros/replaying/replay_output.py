"""Writes the messages of a replay (topics: docs/roboticists.md) as they are solved, and at the end the verdict."""

import logging
from collections.abc import Callable, Collection, Iterable, Mapping
from typing import Protocol

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.coupled_body import learned_body
from bodycam_ros.body.equipment import Equipment
from bodycam_ros.body.equipment_report import EquipmentLog, EquipmentRecord
from bodycam_ros.body.urdf import urdf_text
from bodycam_ros.body_state import BodyOutput
from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.camera_image import CameraImage
from bodycam_ros.diagnostics.camera_diagnostics import RegistrationDiagnostics, verdict_status
from bodycam_ros.diagnostics.solver_diagnostics import solver_status
from bodycam_ros.estimation.static_evidence import StaticMeasurement
from bodycam_ros.messages.body import output_messages
from bodycam_ros.messages.diagnostics import Status, diagnostics_message, text_message
from bodycam_ros.messages.factory import Message
from bodycam_ros.messages.segment_poses import SEGMENT_POSES, segment_poses_message
from bodycam_ros.messages.timing import TIMING, timing_messages
from bodycam_ros.messages.tracks import map_points_message
from bodycam_ros.quality.camera_poses import CameraPoseLog
from bodycam_ros.quality.equipment_findings import equipment_findings
from bodycam_ros.quality.judge import judge
from bodycam_ros.quality.static_camera_findings import StaticCameraLog
from bodycam_ros.quality.unsolved_findings import unsolved_findings
from bodycam_ros.recording.typestore import recorded_messages
from bodycam_ros.registration.readout_time import ReadoutLog
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.replaying.camera_worker import LeftOutImages, Result, UnusableCount, UnusableImages
from bodycam_ros.replaying.preview import preview_finding
from bodycam_ros.replaying.replay_record import SolverOutcome, StretchRecord
from bodycam_ros.replaying.replay_remarks import CameraSpans
from bodycam_ros.replaying.replay_summary import ReplaySummary
from bodycam_ros.results.provenance import VERDICT_FILE
from bodycam_ros.results.verdict import VERDICT, verdict_text
from bodycam_ros.timing.clock_state import ClockHistory

logger = logging.getLogger(__name__)

_DIAGNOSTICS_PERIOD_NS = 1_000_000_000
_SHOWN_REASONS = 2


class BagOutput(Protocol):
    """A bag, or several in turns, that messages are written to."""

    def write(self, topic: str, stamp_ns: int, message: Message) -> None:
        """Append a message, as ``RecordingWriter``."""

    def write_serialized(self, topic: str, message_type: str, stamp_ns: int, cdr: bytes | memoryview) -> None:
        """Append a message that is CDR already."""

    def attach(self, name: str, media_type: str, content: str, stamp_ns: int = 0) -> None:
        """Append a file."""


class ReplayOutput:
    """The messages of a replay, on their way into the bag, and what they amount to.

    Args:
        writer: of the bag.
        body: that is solved, with its equipment.
        clocks: gives the present clocks of the cameras.
        log: of the registrations.
        cameras: models of the body cameras, by name.
        stations: names of the static ones.
        reference_map: in which body cameras are registered, if any.
        equipment: what the body is coupled to, if anything.
        summary: of the replay, which is filled in.
    """

    def __init__(
        self,
        writer: BagOutput,
        body: BodyModel,
        clocks: Callable[[], Mapping[str, ClockHistory]],
        log: CameraPoseLog,
        cameras: Mapping[str, CameraModel],
        stations: Collection[str],
        reference_map: ReferenceMap | None,
        equipment: Equipment | None,
        summary: ReplaySummary,
    ) -> None:
        self._writer = writer
        self._body = body
        self._clocks = clocks
        self._log = log
        self._map = reference_map
        self._equipment = equipment
        self._summary = summary
        self._make = recorded_messages()
        self._diagnostics = RegistrationDiagnostics(cameras)
        self._report_due_ns = self._latest_ns = 0
        self._unusable = UnusableCount()
        self._readouts, self._spans = ReadoutLog(cameras), CameraSpans([*cameras, *stations])
        self._coupled, self._static = EquipmentLog(), StaticCameraLog()

    @property
    def unusable(self) -> str:
        """Why no image could be used, if none could; else empty."""
        return "" if self._summary.images else "; ".join(self._unusable.reasons[:_SHOWN_REASONS])

    def write_image(self, item: Result | CameraImage) -> None:
        """One image's tracks, landmarks and pose, if it has any, and the cameras' health once a second."""
        if isinstance(item, UnusableImages):
            self._unusable.add(item)
            return
        if isinstance(item, LeftOutImages):
            self._summary.left_out[item.camera] += item.count
            return
        if not self._summary.images:
            self._begin(item.stamp_ns)
        self._latest_ns = item.stamp_ns
        self._summary.images[item.camera] += 1
        self._spans.add(item.camera, item.stamp_ns)
        if isinstance(item, CameraImage):
            return
        self._readouts.add(item.matches)
        self._summary.registered[item.camera] += item.matches.world_T_camera is not None
        self._diagnostics.add(item.matches)
        for message in item.messages:
            self._writer.write_serialized(*message)
        if item.stamp_ns >= self._report_due_ns:
            self._report_due_ns = item.stamp_ns + _DIAGNOSTICS_PERIOD_NS
            self._write_diagnostics(item.stamp_ns)

    def write_measured(self, stamps_ns: Mapping[str, int], measured: StaticMeasurement) -> None:
        """Measurements of static cameras of the segments at a time, each with the stamp of its own image."""
        names = self._body.segments
        self._static.add_measured(stamps_ns, measured, names)
        for station, evidence in measured.evidence.items():
            self._summary.registered[station] += bool(evidence)
            seen = evidence, names, measured.confidence[station]
            message = segment_poses_message(self._make, stamps_ns[station], station, *seen)
            self._writer.write(f"/{station}{SEGMENT_POSES}", stamps_ns[station], message)

    def write_states(self, outputs: Iterable[BodyOutput]) -> None:
        """The body at some times."""
        for output in outputs:
            self._summary.solved += 1
            self._summary.predicted += output.state.predicted
            self._log.add_state(output.state.stamp_ns, output.state.world_T_segment)
            if output.state.equipment is not None:
                self._coupled.add(output.state.stamp_ns, output.state.equipment)
            for topic, message in output_messages(self._make, output, self._body).items():
                self._writer.write(topic, output.state.stamp_ns, message)

    def record(self, number: int, count: int, outcome: SolverOutcome) -> StretchRecord:
        """All that was collected of a stretch of a recording.

        Args:
            number, count: which stretch it is, from 0 on, and how many there are.
            outcome: of the solver.
        """
        summary = self._summary
        return StretchRecord(
            number=number,
            count=count,
            start_ns=summary.start_ns,
            latest_ns=self._latest_ns,
            images=summary.images,
            registered=summary.registered,
            left_out=summary.left_out,
            solved=summary.solved,
            predicted=summary.predicted,
            spans_ns=self._spans.known,
            readouts=self._readouts.latest,
            unusable=tuple(self._unusable.items.values()),
            outcome=outcome,
            poses=self._log.logged(),
        )

    def extend(self, later: StretchRecord) -> None:
        """Collect what another replay did of the next stretch of the recording; its messages are in its own bag."""
        summary = self._summary
        if later.images and not summary.images:
            self._begin(later.start_ns)
        self._latest_ns = max(self._latest_ns, later.latest_ns)
        summary.images += later.images
        summary.registered += later.registered
        summary.left_out += later.left_out
        summary.solved += later.solved
        summary.predicted += later.predicted
        self._spans.extend(later.spans_ns)
        self._readouts.extend(later.readouts)
        for item in later.unusable:
            self._unusable.add(item)
        self._log.extend(later.poses)

    def add_missing(self, items: Iterable[UnusableImages]) -> None:
        """Count images that are in no stretch of the recording."""
        for item in items:
            self._unusable.add(item)

    def finish(self, bare: Collection[str], outcome: SolverOutcome) -> None:
        """What is known at the end alone: the robot, the clocks, and whether the result may be used.

        Args:
            bare: segments without a body camera, which static cameras should observe.
            outcome: of the solver.
        """
        summary = self._summary
        summary.equipment = self._coupled.record()
        self._write_robot(summary.equipment)
        self._unusable.warn_of_others()
        summary.skipped, summary.lost = self._unusable.skipped, self._unusable.lost
        summary.images += summary.skipped
        summary.readouts = self._readouts.readouts()
        summary.timings = {
            camera: ClockHistory(camera, clocks, summary.readouts.get(camera))
            for camera, clocks in outcome.clocks.items()
        }
        for camera, timing in summary.timings.items():
            for since_ns, message in timing_messages(self._make, timing):
                self._writer.write(f"/{camera}{TIMING}", since_ns, message)
        poses = self._log.poses()
        summary.speeds = poses.speeds()
        counts = outcome.counts
        findings = (
            *equipment_findings(summary.equipment, self._equipment),
            *self._static.findings(bare),
            *unsolved_findings(summary.solved, counts.contradictory, counts.rejected),
            *([preview_finding(summary.preview)] if summary.preview else ()),
        )
        summary.verdict = judge(poses, findings)
        text = verdict_text(summary.verdict)
        self._writer.write(VERDICT, self._latest_ns, text_message(self._make, text))
        self._writer.attach(VERDICT_FILE, "application/json", text, self._latest_ns)
        self._write_diagnostics(self._latest_ns, verdict_status(summary.verdict), solver_status(counts))
        summary.interpolated, summary.rejected = counts.interpolated, counts.rejected
        summary.frames = outcome.frames + summary.interpolated
        summary.late = outcome.late
        if summary.late:
            logger.warning(
                "%d registrations came too late: their frames had been solved without them. If a camera pauses for "
                "longer than assembler.max_wait, raise that setting",
                summary.late,
            )
        doubts = self._readouts.doubts().values()
        summary.remarks = (*self._spans.remarks(), *doubts, *outcome.remarks, *counts.remarks())

    def _begin(self, stamp_ns: int) -> None:
        """What is known from the start: the map, if there is one."""
        self._summary.start_ns = stamp_ns
        self._report_due_ns = stamp_ns + _DIAGNOSTICS_PERIOD_NS
        if self._map is not None:
            points = map_points_message(self._make, stamp_ns, self._map.points_world, self._map.colours)
            self._writer.write("/map/points", stamp_ns, points)

    def _write_robot(self, coupled: EquipmentRecord | None) -> None:
        """The robot, as of the beginning, but with the lengths of its equipment that the recording gave."""
        body = self._body
        if coupled is not None and self._equipment is not None:
            body = learned_body(body, self._equipment, coupled.values)
        self._writer.write("/robot_description", self._summary.start_ns, text_message(self._make, urdf_text(body)))

    def _write_diagnostics(self, stamp_ns: int, *more: Status) -> None:
        """How the cameras fared since the last report."""
        clocks = {camera: timing.latest for camera, timing in self._clocks().items()}
        statuses = [*self._diagnostics.report(clocks), *more]
        self._writer.write("/diagnostics", stamp_ns, diagnostics_message(self._make, stamp_ns, statuses))
