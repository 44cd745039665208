"""What a replay writes: every message of the wire contract (DESIGN 3), as it becomes known."""

from collections.abc import Iterable, Mapping

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.urdf import urdf_text
from bodycam_ros.body_state import BodyOutput
from bodycam_ros.equipment.equipment import Equipment
from bodycam_ros.equipment.equipment_record import EquipmentLog
from bodycam_ros.equipment.learned_body import learned_body
from bodycam_ros.estimation.seen_body import SeenBody
from bodycam_ros.messages.body import output_messages
from bodycam_ros.messages.clocks import TIMING, timing_messages
from bodycam_ros.messages.health import RegistrationHealth, verdict_health
from bodycam_ros.messages.map_points import map_points_message
from bodycam_ros.messages.segment_poses import SEGMENT_POSES, segment_poses_message
from bodycam_ros.messages.status import Health, diagnostics_message, text_message
from bodycam_ros.offline.camera_worker import RegisteredImage
from bodycam_ros.offline.replay_summary import ReplaySummary
from bodycam_ros.recording.bag_writer import RecordingWriter
from bodycam_ros.recording.typestore import recorded_messages
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.timing.clock_history import ClockHistory
from bodycam_ros.timing.clock_watch import ClockWatch
from bodycam_ros.verdict.agreement import AgreementLog
from bodycam_ros.verdict.outside_findings import SeenSegments
from bodycam_ros.verdict.stored_verdict import VERDICT, verdict_text
from bodycam_ros.verdict.verdict import Verdict

_DIAGNOSTICS_PERIOD_NS = 1_000_000_000


class ReplayOutput:
    """The messages of a replay, on their way into the bag.

    Attributes:
        coupled: what was said of the equipment so far.
        seen: which segments static cameras saw so far.
    """

    def __init__(
        self,
        writer: RecordingWriter,
        body: BodyModel,
        health: RegistrationHealth,
        summary: ReplaySummary,
        log: AgreementLog,
        watch: ClockWatch,
        equipment: Equipment | None,
    ) -> None:
        self._writer = writer
        self._body = body
        self._health = health
        self._summary = summary
        self._log = log
        self._watch = watch
        self._equipment = equipment
        self._make = recorded_messages()
        self._health_due_ns = -1
        self._begun_ns = 0
        self.coupled = EquipmentLog()
        self.seen = SeenSegments()

    def write_latched(self, stamp_ns: int, reference_map: ReferenceMap | None) -> None:
        """What is known from the start: the map, if there is one."""
        self._health_due_ns = stamp_ns + _DIAGNOSTICS_PERIOD_NS
        self._begun_ns = stamp_ns
        if reference_map is not None:
            points = map_points_message(self._make, stamp_ns, reference_map.points_world, reference_map.colours)
            self._writer.write("/map/points", stamp_ns, points)

    def write_robot(self) -> None:
        """The robot, as of the beginning, but with the lengths of its equipment that the recording gave."""
        body, coupled = self._body, self.coupled.record()
        if coupled is not None and self._equipment is not None:
            body = learned_body(body, self._equipment, coupled.values)
        text = text_message(self._make, urdf_text(body))
        self._writer.write("/robot_description", self._begun_ns, text)

    def write_timings(self, timings: Mapping[str, ClockHistory]) -> None:
        """Every camera's clock, from the beginning and from each time on that it was set."""
        for camera, timing in timings.items():
            for since_ns, message in timing_messages(self._make, timing):
                self._writer.write(f"/{camera}{TIMING}", since_ns, message)

    def write_registration(self, image: RegisteredImage) -> None:
        """One image's tracks, landmarks and pose, and the cameras' health once a second."""
        self._summary.registered[image.camera] += image.matches.world_T_camera is not None
        self._health.add(image.matches)
        for message in image.messages:
            self._writer.write_serialized(message.topic, message.message_type, image.stamp_ns, message.cdr)
        if image.stamp_ns >= self._health_due_ns:
            self._health_due_ns = image.stamp_ns + _DIAGNOSTICS_PERIOD_NS
            self.write_health(image.stamp_ns)

    def write_seen(self, stamps_ns: Mapping[str, int], seen: SeenBody) -> None:
        """What static cameras say of the segments at an instant, each with the stamp of its own image."""
        names = self._body.segments
        self.seen.add(each.segment for each in seen.together)
        for station, evidence in seen.evidence.items():
            self._summary.registered[station] += bool(evidence)
            confidence = dict(zip(names, seen.confidence[station].tolist(), strict=True))
            message = segment_poses_message(self._make, stamps_ns[station], station, evidence, confidence)
            self._writer.write(f"/{station}{SEGMENT_POSES}", stamps_ns[station], message)

    def write_health(self, stamp_ns: int, *more: Health) -> None:
        """How the cameras fared since the last report."""
        clocks = {camera: timing.latest for camera, timing in self._watch.timings.items()}
        health = [*self._health.report(clocks), *more]
        self._writer.write("/diagnostics", stamp_ns, diagnostics_message(self._make, stamp_ns, health))

    def write_verdict(self, stamp_ns: int, verdict: Verdict) -> None:
        """Whether the result may be used: for ``bodycam evaluate``, and with the last health for people."""
        text = text_message(self._make, verdict_text(verdict))
        self._writer.write(VERDICT, stamp_ns, text)
        self.write_health(stamp_ns, verdict_health(verdict))

    def write_states(self, outputs: Iterable[BodyOutput]) -> None:
        """The body at some instants."""
        for output in outputs:
            self._summary.solved += 1
            self._summary.predicted += output.state.predicted
            self._log.add_state(output.state.stamp_ns, output.state.world_T_segment)
            if output.state.equipment is not None:
                self.coupled.add(output.state.stamp_ns, output.state.equipment)
            for topic, message in output_messages(self._make, output, self._body).items():
                self._writer.write(topic, output.state.stamp_ns, message)
