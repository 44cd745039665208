"""Node ``skeleton_solver``: the registrations of all cameras in, the articulated body out (A 4.3).

With a rig it first calibrates the body from a range of motion (A 4.2).
"""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from bodycam_ros.body.average_person import with_hands
from bodycam_ros.body.body_file import read_body
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.coupled_body import coupled_body, held_equipment
from bodycam_ros.body.equipment import Equipment
from bodycam_ros.body.equipment_report import EquipmentReport
from bodycam_ros.body.equipment_yaml import read_equipment
from bodycam_ros.body_state import BodyOutput
from bodycam_ros.camera.camera_image import CameraImage
from bodycam_ros.diagnostics.camera_diagnostics import verdict_status
from bodycam_ros.diagnostics.dropped_messages import DroppedMessages, LostMessages
from bodycam_ros.diagnostics.solver_diagnostics import SolverDiagnostics, equipment_status
from bodycam_ros.errors import BodyError, StaticCameraError
from bodycam_ros.estimation.static_evidence import StaticMeasurement
from bodycam_ros.formats.static_cameras_file import read_static_cameras
from bodycam_ros.graph.node_parameters import SOLVER_GROUPS, SolverParameters
from bodycam_ros.messages.diagnostics import Status
from bodycam_ros.messages.segment_poses import SEGMENT_POSES, SEGMENT_POSES_TYPE, segment_poses_message
from bodycam_ros.messages.tracks import LANDMARKS_TYPE, landmark_matches
from bodycam_ros.nodes.body_topics import BodyTopics
from bodycam_ros.nodes.camera_images import CameraImages
from bodycam_ros.nodes.camera_topics import CameraModels, CameraTimings, subscribe_sensor
from bodycam_ros.nodes.moments import ClockTimes, Moment
from bodycam_ros.nodes.parameters import STAGE_DEPTH, reliable
from bodycam_ros.nodes.stage_node import Stage, StageNode
from bodycam_ros.pipeline.skeleton import SkeletonPipeline
from bodycam_ros.pipeline.static_cameras import image_measurement
from bodycam_ros.quality.judge import LiveVerdict
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.registration.reference_map import load_map
from bodycam_ros.static_cameras.start_file import StaticCameraFiles
from bodycam_ros.static_cameras.static_camera import StaticCamera
from bodycam_ros.static_cameras.static_measurement import ImageMeasurement

if TYPE_CHECKING:
    from bodycam_ros.graph.live_calibration import LiveCalibration

_POLL_S, _CALIBRATION_POLL_S = 0.5, 0.2


class SolverStage(Stage[SolverParameters]):
    """Solves the body by the registrations of the cameras that there are.

    With a rig it needs the camera_info of all of the rig's cameras, and has no body to solve until one is made. It
    restarts where the time of most cameras goes back. While it is inactive it keeps the body, the collected range of
    motion, and the cameras' clocks.
    """

    name, parameters_type, groups = "skeleton_solver", SolverParameters, SOLVER_GROUPS

    def __init__(self, node: StageNode[SolverParameters]) -> None:
        super().__init__(node)
        given = self.parameters
        self.required("body")
        self.settings.estimator.check_live()
        equipment = read_equipment(given.equipment) if given.equipment else None
        self._stations = _read_static_cameras(given)
        self._static_cameras: ImageMeasurement | None = None
        self._person: BodyModel | None = None
        self._body: BodyModel | None = None  # with the part of the equipment that fits it
        self._equipment: Equipment | None = None
        self._coupling: EquipmentReport | None = None
        self._pipeline: SkeletonPipeline | None = None  # without a body
        self._verdict: LiveVerdict | None = None
        self._is_flushed = True
        self._calibration: LiveCalibration | None = None
        if given.rig:
            from bodycam_ros.graph import live_calibration  # it loads matplotlib

            self._calibration = live_calibration.LiveCalibration(given, equipment)
        self._carried = carried = self._read_body() if self._calibration is None else self._calibration.cameras
        self._topics = BodyTopics(self, with_equipment=equipment is not None)
        self._segment_poses = {
            station: self.publisher(SEGMENT_POSES_TYPE, f"{station}{SEGMENT_POSES}", reliable(STAGE_DEPTH))
            for station in self._stations
        }
        self._observed = {station: Counter[str]() for station in self._stations}  # segments since the last report
        self._confidence = dict.fromkeys(self._stations, 0.0)  # of these, summed
        self._timings = CameraTimings(self, carried)
        self._is_described = False
        self._lost = LostMessages()
        for camera in carried:
            registered = LANDMARKS_TYPE, f"{camera}/landmarks", self._add_landmarks, reliable(STAGE_DEPTH)
            self.subscription(*registered, partial(landmark_matches, camera=camera), "registrations dropped")
            subscribe_sensor(self, camera, partial(self._add_sample, camera))
        self.trigger("~/flush", lambda: f"{self._flush()} frames published")
        self.trigger("~/reset", self._reset)
        if self._calibration is not None:
            self.trigger("~/calibrate", self._calibration.make_body)
            self.trigger("~/start_calibration", self._calibration.restart)
            self.every(_CALIBRATION_POLL_S, self._poll_calibration, even_inactive=True)
        self._images = {
            station: CameraImages(self, station, DroppedMessages(self.log.warning), self._add_static)
            for station in self._stations
        }
        # Last: a node whose subscription to camera_info is discovered reads the rest too.
        self._cameras = CameraModels(self, carried, self._set_model, self._add_image)
        self._diagnostics = SolverDiagnostics(self.dropped, given.body_cameras)
        self._solve()
        self.every(_POLL_S, self._poll)

    def activate(self) -> None:
        """Publish the body's description."""
        if self._body is not None and not self._is_described:
            self._describe(self._body)

    def pause(self) -> None:
        """Publish the frames that wait for later ones, and cancel a calibration."""
        if self._calibration is not None:
            self._set_person(self._calibration.stop())
        self._flush()
        self._lost = LostMessages()
        for images in self._images.values():
            images.drop()

    def finish(self) -> None:
        """The same, and wait until the readers have received them."""
        self.pause()
        self._topics.finish()

    def _reset(self) -> str:
        """Forget the motion, the clocks and the cameras."""
        flushed = self._flush()
        self._lost = LostMessages()
        self._solve()
        return f"{flushed} frames published; the body restarts"

    def _describe(self, body: BodyModel) -> None:
        self._is_described = True
        self._topics.describe(body, self._equipment)

    def _read_body(self) -> tuple[str, ...]:
        """Read the body file; return the names of the cameras to use.

        Raises:
            BodyError: it cannot be used, or lacks a camera that is asked for.
        """
        path, asked = Path(self.parameters.body), self.parameters.cameras
        cameras = tuple(self._use_person(read_body(path)).mounts)
        if not self.parameters.body_cameras:
            return ()
        if not cameras or not {*asked} <= {*cameras}:
            unknown = ", ".join(camera for camera in asked if camera not in cameras)
            raise BodyError(f"{path}: the body has no camera {unknown}; it has {', '.join(cameras) or 'none'}")
        return tuple(dict.fromkeys(asked)) or cameras

    def _use_person(self, person: BodyModel) -> BodyModel:
        """Set the person; return the body to solve, which has the equipment too if there is any."""
        given = self.parameters
        person = with_hands(person) if self._stations else person
        # Fitted once, so that what does not fit is reported once.
        self._equipment = held_equipment(given.equipment, person) if given.equipment else None
        self._person, self._body = person, coupled_body(person, self._equipment)
        if self._stations:
            surface, start = (Path(name) if name else None for name in (given.surface, given.start))
            files, path = StaticCameraFiles(Path(given.stations), surface, start), Path(given.body)
            self._static_cameras = image_measurement(
                files, self._stations, self._body, path, self.settings, self._publish_seen, live=True
            )
        return self._body

    def _set_model(self, camera: str) -> None:
        """Start to collect a range of motion once all models are there; the verdict judges by the present ones."""
        if self._calibration is not None and not (self._cameras.missing or self._cameras.rejected):
            self._calibration.start(self._cameras.models, self.settings)
        self._restart_verdict()

    def _solve(self) -> None:
        """Start to solve without a past, if there is a body."""
        person, body = self._person, self._body
        if person is None or body is None:
            return
        self._pipeline = SkeletonPipeline(
            person,
            self._carried,
            self.settings,
            live=True,
            on_corrected=self._judge_registration,
            equipment=self._equipment,
            static_cameras=self._static_cameras,
            stations=self._stations,
        )
        self._restart_verdict()
        self._timings.set_body(body)

    def _restart_verdict(self) -> None:
        if self._body is not None:
            self._verdict = LiveVerdict(self._body, self._cameras.models, self.settings.pose_fit)

    def _judge_registration(self, matches: LandmarkMatches) -> None:
        """Add a registration with its corrected stamp, for the verdict compares cameras at one time."""
        if self._verdict is not None:
            self._verdict.add_registration(matches)

    def _poll_calibration(self) -> None:
        if self._calibration is not None:
            self._set_person(self._calibration.poll())

    def _set_person(self, person: BodyModel | None) -> None:
        """Solve a new body, if there is one, from the next registrations on."""
        if person is not None:
            self._flush()
            body = self._use_person(person)
            self._solve()
            self._describe(body)

    def _add_landmarks(self, matches: LandmarkMatches) -> None:
        camera = matches.camera
        self.moments.note(Moment.LANDMARKS_RECEIVED, camera, matches.stamp_ns)
        if self._lost.add(camera, matches.stamp_ns, matches.previous_stamp_ns):
            reason = f"camera {camera}: the registration before {matches.stamp_ns} ns is lost"
            self.dropped.add("registrations lost", reason)
        self._diagnostics.add_registration(matches.stamp_ns)
        self._add(matches)

    def _add_sample(self, camera: str, stamp_ns: int, reading: tuple[float, ...]) -> None:
        if self._pipeline is not None and (outputs := self._pipeline.add_sample(camera, stamp_ns, reading)):
            self._publish(outputs)

    def _add_image(self, stamp_ns: int) -> None:
        if self._pipeline is not None:
            self._pipeline.add_image(stamp_ns)

    def _add_static(self, image: CameraImage) -> bool:
        self._diagnostics.add_registration(image.stamp_ns)
        self._add(image)
        return True

    def _publish_seen(self, stamps_ns: Mapping[str, int], seen: StaticMeasurement) -> None:
        """Publish what static cameras measured, each with the stamp of its own image [ns]."""
        assert self._body is not None
        for station, evidence in seen.evidence.items():
            confidence = seen.confidence[station]
            measured = evidence, self._body.segments, confidence
            message = segment_poses_message(self.make, stamps_ns[station], station, *measured)
            self._segment_poses[station].publish(message)
            self._observed[station].update(each.segment for each in evidence)
            rows = [self._body.segment_index[each.segment] for each in evidence]
            self._confidence[station] += float(confidence[rows].sum())

    def _add(self, measured: LandmarkMatches | CameraImage) -> None:
        if isinstance(measured, LandmarkMatches) and self._calibration is not None:
            self._calibration.add(measured)
        self._is_flushed = False
        if self._pipeline is not None:
            started = self.moments.now()
            self._publish(self._pipeline.add(measured), started)

    def _poll(self) -> None:
        if self._pipeline is None:
            return
        if self._diagnostics.quiet_s > self.parameters.idle_flush:
            self._flush()
        else:
            self._pipeline.assembler.max_wait_ns = round(1e9 * self.settings.assembler.max_wait)
            self._publish(self._pipeline.poll())
        self._timings.publish_clocks(self._pipeline.clocks.histories)

    def _flush(self) -> int:
        """Publish the frames that wait for later ones; return their number."""
        if self._is_flushed or self._pipeline is None:
            return 0
        self._is_flushed = True
        outputs = self._pipeline.flush()
        self._publish(outputs)
        return len(outputs)

    def _publish(self, outputs: Sequence[BodyOutput], started: ClockTimes | None = None) -> None:
        pipeline, body = self._pipeline, self._body
        if pipeline is None or body is None:
            return
        for output in outputs:
            if self._verdict is not None:
                self._verdict.add_state(output.state.stamp_ns, output.state.world_T_segment)
            # Interpolated states have no report.
            self._coupling = output.state.equipment or self._coupling
            self._topics.publish(output, body)
            if started is not None:
                self.moments.note(Moment.SOLVING, "", output.state.stamp_ns, started)
            self._diagnostics.add_state(output.state)

    def report(self) -> list[Status]:
        """Status of the body and its cameras since the last report."""
        statuses = self._diagnostics.report(self._pipeline)
        statuses += self._static_statuses()
        statuses += [] if self._coupling is None else [equipment_status(self._coupling)]
        statuses += [] if self._verdict is None else [verdict_status(self._verdict.verdict())]
        return statuses if self._calibration is None else [*statuses, self._calibration.report()]

    def _static_statuses(self) -> Iterator[Status]:
        """Status of the static cameras since the last report."""
        for station, images in self._images.items():
            observed, confidence = self._observed[station], self._confidence[station]
            self._observed[station], self._confidence[station] = Counter(), 0.0
            total, segments = observed.total(), self._body.segments if self._body else ()
            values = {
                "segments per image": images.tally.mean(total),
                "confidence": round(confidence / total, 2) if total else "none",
                "unobserved": ", ".join(segment for segment in segments if not observed[segment]) or "none",
            }
            error = "" if total else "no segment of the body is observed; is it in front of the camera?"
            yield replace(images.status(values, error), name=f"static camera {station}")


def _read_static_cameras(parameters: SolverParameters) -> dict[str, StaticCamera]:
    """Static cameras of the solver in the frame of its map, or of their file without one; empty without ``stations``.

    Raises:
        StaticCameraError, LensError, MapError: a file cannot be used, a body is to be calibrated, there is no initial
            estimate of the body, or a parameter of static cameras is given without any.
    """
    stations, start, body_cameras = parameters.stations, parameters.start, parameters.body_cameras
    if not stations:
        if start or not body_cameras:
            given = f"start {start}" if start else "body_cameras false"
            raise StaticCameraError(f"{given}: is for static cameras; give their file as the parameter 'stations'")
        return {}
    if parameters.rig:
        raise StaticCameraError(
            f"{stations}: static cameras are not used in a range of motion; make the body first, then start again "
            "with 'stations' and without 'rig'"
        )
    if not body_cameras and not start:
        raise StaticCameraError(
            f"{stations}: static cameras alone need an initial estimate of the body; place it by hand in a "
            "recording with 'bodycam view --place', and give that as the parameter 'start'"
        )
    reference_map = load_map(Path(parameters.map)) if parameters.map else None
    return read_static_cameras(Path(stations), reference_map)


make = partial(StageNode, SolverStage)
"""Constructor of the node."""
