"""What a replay writes: every message of the wire contract (DESIGN 3), as it becomes known.

Clocks that are off by less than the recording are learned from the motion, see ``bodycam_ros.timing``.
"""

import math
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.coupled_body import learned_body
from bodycam_ros.body.equipment import Equipment
from bodycam_ros.body.equipment_report import EquipmentLog
from bodycam_ros.body.urdf import urdf_text
from bodycam_ros.body_state import BodyOutput
from bodycam_ros.estimation.static_evidence import StaticMeasurement
from bodycam_ros.live.camera_diagnostics import RegistrationDiagnostics, verdict_status
from bodycam_ros.messages.body import output_messages
from bodycam_ros.messages.diagnostics import Status, diagnostics_message, text_message
from bodycam_ros.messages.factory import MessageFactory
from bodycam_ros.messages.segment_poses import SEGMENT_POSES, segment_poses_message
from bodycam_ros.messages.timing import TIMING, timing_messages
from bodycam_ros.messages.tracks import map_points_message
from bodycam_ros.offline.camera_worker import RegisteredImage
from bodycam_ros.offline.replay_summary import ReplaySummary
from bodycam_ros.quality.camera_poses import CameraPoseLog
from bodycam_ros.quality.static_camera_findings import StaticCameraLog
from bodycam_ros.recording.bag_writer import RecordingWriter
from bodycam_ros.recording.typestore import recorded_messages
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.timing.clock_estimator import ClockEstimator
from bodycam_ros.timing.clock_state import ClockHistory, ClockState
from bodycam_ros.verdict import VERDICT, Verdict, verdict_text

_DIAGNOSTICS_PERIOD_NS = 1_000_000_000


@dataclass
class ReplayOutput:
    """The messages of a replay, on their way into the bag.

    Attributes:
        coupled: how the equipment was coupled so far.
        static: what static cameras observed so far.
    """

    _writer: RecordingWriter
    _body: BodyModel
    _diagnostics: RegistrationDiagnostics
    _summary: ReplaySummary
    _log: CameraPoseLog
    _clocks: ClockEstimator
    _equipment: Equipment | None
    coupled: EquipmentLog = field(default_factory=EquipmentLog, init=False)
    static: StaticCameraLog = field(default_factory=StaticCameraLog, init=False)
    _make: MessageFactory = field(default_factory=recorded_messages, init=False)
    _report_due_ns: int = field(default=-1, init=False)
    _begun_ns: int = field(default=0, init=False)

    def write_latched(self, stamp_ns: int, reference_map: ReferenceMap | None) -> None:
        """What is known from the start: the map, if there is one."""
        self._report_due_ns = stamp_ns + _DIAGNOSTICS_PERIOD_NS
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
        self._diagnostics.add(image.matches)
        for message in image.messages:
            self._writer.write_serialized(*message)
        if image.stamp_ns >= self._report_due_ns:
            self._report_due_ns = image.stamp_ns + _DIAGNOSTICS_PERIOD_NS
            self.write_diagnostics(image.stamp_ns)

    def write_seen(self, stamps_ns: Mapping[str, int], seen: StaticMeasurement) -> None:
        """Measurements of static cameras of the segments at an instant, each with the stamp of its own image."""
        names = self._body.segments
        self.static.add(
            min(stamps_ns.values()),
            [each.segment for each in seen.together],
            [names[row] for row in seen.unsupported],
            seen.misplaced,
        )
        for station, evidence in seen.evidence.items():
            self._summary.registered[station] += bool(evidence)
            confidence = dict(zip(names, seen.confidence[station].tolist(), strict=True))
            message = segment_poses_message(self._make, stamps_ns[station], station, evidence, confidence)
            self._writer.write(f"/{station}{SEGMENT_POSES}", stamps_ns[station], message)

    def write_diagnostics(self, stamp_ns: int, *more: Status) -> None:
        """How the cameras fared since the last report."""
        clocks = {camera: timing.latest for camera, timing in self._clocks.histories.items()}
        statuses = [*self._diagnostics.report(clocks), *more]
        self._writer.write("/diagnostics", stamp_ns, diagnostics_message(self._make, stamp_ns, statuses))

    def write_verdict(self, stamp_ns: int, verdict: Verdict) -> None:
        """Whether the result may be used: for ``bodycam evaluate``, and with the last health for people."""
        text = text_message(self._make, verdict_text(verdict))
        self._writer.write(VERDICT, stamp_ns, text)
        self.write_diagnostics(stamp_ns, verdict_status(verdict))

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


_WORTH_SAYING_S = 0.003
"""A limb at 3 m/s is 1 cm further by then."""

_POORLY_KNOWN_S = 0.004
_UP_TO_SIGMAS = 2.0


def clock_remarks(
    timings: Mapping[str, ClockHistory],
    speeds: Mapping[str, tuple[float, float]],
) -> tuple[str, ...]:
    """A line for every clock that was off, was set, or stayed unknown.

    Args:
        timings: camera -> how its clock went.
        speeds: camera -> how fast it turned and moved [rad/s, m/s].
    """
    lines = []
    for camera, timing in sorted(timings.items()):
        speed = speeds.get(camera, (math.nan, math.nan))
        lines += [f"camera {camera}: {remark}" for remark in _of_camera(timing, speed)]
    return tuple(lines)


def _of_camera(timing: ClockHistory, speed: tuple[float, float]) -> Iterator[str]:
    first = timing.clocks[0]
    if timing.is_off and abs(first.offset) > max(_WORTH_SAYING_S, 2.0 * first.offset_sigma):
        drifted = f", and drifted by {1e6 * first.drift:+.0f} ppm" if _drifts(first) else ""
        side = "ahead" if first.offset > 0 else "behind"
        size = f"{1e3 * abs(first.offset):.1f} ms {side} (+-{1e3 * first.offset_sigma:.1f})"
        yield f"its clock was {size}{drifted}; corrected"
    for stamp_ns, by_s in timing.jumps:
        after_s = 1e-9 * (stamp_ns - first.since_ns)
        yield f"its clock jumped by {1e3 * by_s:+.0f} ms after {after_s:.1f} s; corrected"
    if (sigma := timing.latest.offset_sigma) > _POORLY_KNOWN_S:
        left = [_UP_TO_SIGMAS * sigma * each for each in speed]
        size = ""
        if all(math.isfinite(each) for each in left):
            size = f": up to {1e3 * left[1]:.0f} mm and {math.degrees(left[0]):.1f} deg may be left"
        yield f"its clock is known to {1e3 * sigma:.0f} ms only, for it hardly moved{size}"


def _drifts(clock: ClockState) -> bool:
    return abs(clock.drift) > 2.0 * clock.drift_sigma


class CameraSpans:
    """First and last stamps by camera.

    Args:
        cameras: that are expected to have images.
    """

    def __init__(self, cameras: Collection[str]) -> None:
        self._spans_ns: dict[str, tuple[int, int] | None] = dict.fromkeys(cameras)

    def add(self, camera: str, stamp_ns: int) -> None:
        """Note an image."""
        first, last = self._spans_ns[camera] or (stamp_ns, stamp_ns)
        self._spans_ns[camera] = min(first, stamp_ns), max(last, stamp_ns)

    def remarks(self) -> tuple[str, ...]:
        """A line for every camera without images, or with none at the time of the others."""
        lines = []
        for camera, own in self._spans_ns.items():
            others = [span for name, span in self._spans_ns.items() if span is not None and name != camera]
            if own is None:
                lines.append(f"camera {camera}: no image of it could be used")
            elif others and (own[0] > np.median([s[1] for s in others]) or own[1] < np.median([s[0] for s in others])):
                off_s = 1e-9 * (own[0] - float(np.median([span[0] for span in others])))
                side = "ahead of" if off_s > 0 else "behind"
                lines.append(f"camera {camera}: its stamps are {abs(off_s):.1f} s {side} the others'; set its clock")
        return tuple(lines)
