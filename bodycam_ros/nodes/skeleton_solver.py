"""Node ``skeleton_solver``: the registrations of all cameras in, the articulated body out (A 4.3).

With a rig it first calibrates the body from a range of motion (A 4.2). The work is that of
``graph/solver_session.py``; here are its topics, services and timers.
"""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import partial

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.equipment import Equipment
from bodycam_ros.body_state import BodyOutput
from bodycam_ros.diagnostics.dropped_messages import DroppedMessages
from bodycam_ros.diagnostics.static_camera_diagnostics import StaticCameraDiagnostics
from bodycam_ros.estimation.static_evidence import StaticMeasurement
from bodycam_ros.graph.node_parameters import SOLVER_GROUPS, SolverParameters
from bodycam_ros.graph.solver_session import SolverOutputs, SolverSession
from bodycam_ros.messages.diagnostics import Status
from bodycam_ros.messages.segment_poses import SEGMENT_POSES, SEGMENT_POSES_TYPE, segment_poses_message
from bodycam_ros.messages.tracks import LANDMARKS_TYPE, landmark_matches
from bodycam_ros.nodes.body_topics import BodyTopics
from bodycam_ros.nodes.camera_images import CameraImages
from bodycam_ros.nodes.camera_topics import CameraModels, CameraTimings, subscribe_sensor
from bodycam_ros.nodes.moments import ClockTimes, Moment
from bodycam_ros.nodes.parameters import STAGE_DEPTH, reliable
from bodycam_ros.nodes.stage_node import Stage, StageNode
from bodycam_ros.registration.landmark_matches import LandmarkMatches

_POLL_S, _CALIBRATION_POLL_S = 0.5, 0.2


class SolverStage(Stage[SolverParameters]):
    """Solves the body by the registrations of the cameras that there are.

    With a rig it needs the camera_info of all of the rig's cameras. While it is inactive it keeps the body, the
    collected range of motion, and the cameras' clocks.
    """

    name = "skeleton_solver"
    parameters_type = SolverParameters
    groups = SOLVER_GROUPS

    def __init__(self, node: StageNode[SolverParameters]) -> None:
        super().__init__(node)
        self.required("body")
        outputs = SolverOutputs(self._describe, self._publish_timings, self._publish, self._publish_measured)
        self._session = session = SolverSession(self.parameters, self.settings, outputs, self.dropped)
        self._topics = BodyTopics(self, with_equipment=session.has_equipment)
        self._segment_poses = {
            station: self.publisher(SEGMENT_POSES_TYPE, f"{station}{SEGMENT_POSES}", reliable(STAGE_DEPTH))
            for station in session.stations
        }
        self._static = {station: StaticCameraDiagnostics() for station in session.stations}
        self._timings = CameraTimings(self, session.cameras)
        self._is_described = False
        self._started: ClockTimes | None = None
        for camera in session.cameras:
            registered = LANDMARKS_TYPE, f"{camera}/landmarks", self._add_landmarks, reliable(STAGE_DEPTH)
            self.subscription(*registered, partial(landmark_matches, camera=camera), "registrations dropped")
            subscribe_sensor(self, camera, partial(session.add_sample, camera))
        self.trigger("~/flush", lambda: f"{session.flush()} frames published")
        self.trigger("~/reset", session.reset)
        if session.calibration is not None:
            self.trigger("~/calibrate", session.calibration.make_body)
            self.trigger("~/start_calibration", session.calibration.restart)
            self.every(_CALIBRATION_POLL_S, session.poll_calibration, even_inactive=True)
        self._images = {
            station: CameraImages(self, station, DroppedMessages(self.log.warning), session.add_static)
            for station in session.stations
        }
        # Last: a node whose subscription to camera_info is discovered reads the rest too.
        self._cameras = CameraModels(self, session.cameras, self._set_model, session.add_image, logs=True)
        session.start()
        self.every(_POLL_S, self._poll)

    def activate(self) -> None:
        """Publish the body's description."""
        if self._session.body is not None and not self._is_described:
            self._describe(self._session.body, self._session.equipment)

    def pause(self) -> None:
        """Publish the frames that wait for later ones, and cancel a calibration."""
        self._session.pause()
        for images in self._images.values():
            images.drop()

    def finish(self) -> None:
        """The same, and wait until the readers have received them."""
        self.pause()
        self._topics.finish()

    def settings_changed(self) -> None:
        """Use the current values from now on."""
        self._session.given, self._session.settings = self.parameters, self.settings

    def _describe(self, body: BodyModel, equipment: Equipment | None) -> None:
        self._is_described = True
        self._topics.describe(body, equipment)

    def _set_model(self, camera: str) -> None:
        are_complete = not (self._cameras.missing or self._cameras.rejected)
        self._session.set_models(self._cameras.models, are_complete)

    def _add_landmarks(self, matches: LandmarkMatches) -> None:
        self.moments.note(Moment.LANDMARKS_RECEIVED, matches.camera, matches.stamp_ns)
        self._started = self.moments.now()
        self._session.add_registration(matches)
        self._started = None

    def _poll(self) -> None:
        self._session.poll()
        self._timings.publish_clocks(self._session.clocks)

    def _publish_timings(self, body: BodyModel) -> None:
        self._timings.set_body(body)

    def _publish(self, output: BodyOutput, body: BodyModel) -> None:
        self._topics.publish(output, body)
        if self._started is not None:
            self.moments.note(Moment.SOLVING, "", output.state.stamp_ns, self._started)

    def _publish_measured(self, stamps_ns: Mapping[str, int], measured: StaticMeasurement) -> None:
        """Publish what static cameras measured, each with the stamp of its own image [ns]."""
        body = self._session.body
        assert body is not None
        for station, evidence in measured.evidence.items():
            confidence = measured.confidence[station]
            message = segment_poses_message(self.make, stamps_ns[station], station, evidence, body.segments, confidence)
            self._segment_poses[station].publish(message)
            self._static[station].add([each.segment for each in evidence], body.segments, confidence)

    def report(self) -> list[Status]:
        """Status of the body and its cameras since the last report."""
        body, *others = self._session.report()
        return [body, *self._static_statuses(), *others]

    def _static_statuses(self) -> Iterator[Status]:
        segments = self._session.body.segments if self._session.body is not None else ()
        for station, images in self._images.items():
            values, error = self._static[station].report(images.tally.images, segments)
            yield replace(images.status(values, error), name=f"static camera {station}")


make = partial(StageNode, SolverStage)
"""Constructor of the node."""
