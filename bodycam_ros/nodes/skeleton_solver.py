"""Node ``skeleton_solver``: the registrations of all cameras in, the articulated body out (A 4.3).

With a rig instead of a body it first makes the body, from a range of motion (A 4.2).
"""

import time
from collections.abc import Sequence
from functools import partial

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.equipment_yaml import read_equipment
from bodycam_ros.body_state import BodyOutput, SaidSegments
from bodycam_ros.calibration.body_calibrator import CalibrationSettings
from bodycam_ros.errors import BodyError
from bodycam_ros.inertial.imu_samples import ImuSamples
from bodycam_ros.live.flow_of_frames import MissedFrames, Work
from bodycam_ros.live.live_calibration import LiveBody, LiveCalibration
from bodycam_ros.live.node_parameters import SOLVER_GROUPS, SolverParameters
from bodycam_ros.live.solver_health import SolverHealth
from bodycam_ros.live.static_cameras import stations_of_solver
from bodycam_ros.messages.factory import Message
from bodycam_ros.messages.health import Health
from bodycam_ros.messages.imu import IMU_TOPIC, IMU_TYPE, imu_row
from bodycam_ros.messages.tracks import landmark_matches
from bodycam_ros.moments import Instant, Moment
from bodycam_ros.nodes.body_topics import BodyTopics
from bodycam_ros.nodes.camera_topics import CameraModels, CameraTimings
from bodycam_ros.nodes.parameters import STAGE_DEPTH, best_effort, reliable
from bodycam_ros.nodes.stage_node import Stage, StageNode
from bodycam_ros.nodes.stations import Stations
from bodycam_ros.pipeline_settings import PipelineSettings
from bodycam_ros.registration.landmark_matches import LandmarkMatches

_LOOK_S, _CALIBRATION_LOOK_S = 0.5, 0.2
_IMU_DEPTH = 200  # samples that may wait, 0.2 s of a fast sensor


class SolverStage(Stage[SolverParameters]):
    """Solves the body once every camera's camera_info is here, or ``info_wait`` after the first; later ones join.

    With a rig it waits for the camera_info of all of the rig's cameras, and has no body to solve until one is made.
    Where most cameras go back in time, the body begins anew there.
    While it is inactive it keeps the body, what has been collected of a range of motion, and the cameras' clocks.
    """

    name, parameters_type, groups = "skeleton_solver", SolverParameters, SOLVER_GROUPS
    settings_types = PipelineSettings, CalibrationSettings
    action = "bodycam_msgs/action/Calibrate", "~/calibrate"

    def __init__(self, node: StageNode[SolverParameters]) -> None:
        super().__init__(node)
        of = self.parameters
        self.required("body")
        self.settings.smoother.check_live()
        equipment = read_equipment(of.equipment) if of.equipment else None
        stations = stations_of_solver(of)
        self._live = LiveBody(of, lambda: self.settings, stations)
        self._calibration = LiveCalibration(of, equipment) if of.rig else None
        carried = self._live.read() if self._calibration is None else self._calibration.cameras
        self._topics = BodyTopics(self, with_equipment=equipment is not None)
        self._stations = Stations(self, stations, self._on_station) if stations else None
        self._timings = CameraTimings(self, carried)
        self._started = self._is_described = False
        self._waiting: list[LandmarkMatches | SaidSegments] = []
        self._most_waiting = STAGE_DEPTH * (len(carried) + len(stations))
        self._missed = MissedFrames()
        self._first_info_s: float | None = None
        for camera in carried:
            on_landmarks = partial(self._on_landmarks, camera)
            topic = f"{camera}/landmarks"
            self.subscription("bodycam_msgs/msg/LandmarkMatches", topic, on_landmarks, reliable(STAGE_DEPTH))
            on_imu = partial(self._on_imu, camera)
            self.subscription(IMU_TYPE, f"{camera}{IMU_TOPIC}", on_imu, best_effort(_IMU_DEPTH), adapts=True)
        self.trigger("~/flush", lambda: (True, f"{self._flush()} instants published"))
        self.trigger("~/reset", self._reset)
        if self._calibration is not None:
            self.trigger("~/calibrate", self._calibrate)
            self.trigger("~/start_calibration", self._calibration.collect_anew)
            self.every(_CALIBRATION_LOOK_S, self._look_at_calibration, even_inactive=True)
        # The last: who sees it reading camera_info may take it that it reads the rest.
        self._cameras = CameraModels(self, carried, self._on_camera)
        self._health = SolverHealth(self._cameras, self.skipped)
        if not carried:
            self._start()
        self.every(_LOOK_S, self._look)

    def begin(self) -> None:
        """Publish what body it is."""
        if self._live.body is not None and not self._is_described:
            self._describe(self._live.body)

    def pause(self) -> None:
        """Publish what waits for later instants, for these do not come; a body that is being made is given up."""
        if self._calibration is not None:
            self._take(self._calibration.stop())
        if self.node.action is not None:
            self.node.action.stop()
        self._flush()
        self._forget_waiting()

    def finish(self) -> None:
        """The same, and wait until readers have received it."""
        self.pause()
        self._topics.finish()

    def work_on(self, goal: Message) -> Work:
        """For the action ~/calibrate."""
        if self._calibration is None:
            raise BodyError("the node was configured without a rig, so there is nothing to calibrate")
        return self._calibration.make()

    def _calibrate(self) -> tuple[bool, str]:
        if self._calibration is None or not self.node.is_active:
            return False, "the node is inactive; activate it first"
        self._calibration.make()
        path = self._calibration.path
        return True, f"makes {path}; /diagnostics has the progress and the result, and so has the action ~/calibrate"

    def _reset(self) -> tuple[bool, str]:
        """Drop what was learned of the motion, the clocks and the cameras."""
        flushed = self._flush()
        self._forget_waiting()
        if self._live.pipeline is not None:
            self._solve()
        return True, f"{flushed} instants published; the body begins anew"

    def _forget_waiting(self) -> None:
        self._waiting.clear()
        self._missed = MissedFrames()

    def _describe(self, body: BodyModel) -> None:
        self._is_described = True
        self._topics.describe(body, self._live.equipment)

    def _on_camera(self, camera: str) -> None:
        self._first_info_s = self._first_info_s or time.monotonic()
        if not self._started:
            if not self._cameras.missing:
                self._start()
            return
        self._collect()
        if camera in self._cameras.models:
            if self._live.pipeline is not None:
                self._live.join(camera, self._cameras.models)
            else:
                self._solve()

    def _start(self) -> None:
        """Enough cameras are known: from now on they are collected, or the body is solved, or both."""
        self._started = True
        self._collect()
        for camera in self._cameras.missing:
            self.log.warning(f"there is no {camera}/camera_info yet; the camera joins when it comes")
        self._solve()
        for seen in self._waiting:
            self._add(seen)
        self._waiting.clear()

    def _collect(self) -> None:
        if self._calibration is not None and not self._calibration.is_running:
            of = self.node.parameters.of(CalibrationSettings)
            self._calibration.begin(self._cameras.models, self.settings, of)

    def _solve(self) -> None:
        if self._live.begin(self._cameras.models) and self._live.body is not None:
            self._timings.begin(self._live.body)

    def _look_at_calibration(self) -> None:
        if self._calibration is not None:
            self._take(self._calibration.look())

    def _take(self, person: BodyModel | None) -> None:
        """If there is a new body, the registrations from now on are its own."""
        if person is not None:
            self._flush()
            body = self._live.take(person)
            self._solve()
            self._describe(body)

    def _on_landmarks(self, camera: str, message: Message) -> None:
        try:
            matches = landmark_matches(message, camera)
        except ValueError as error:
            self.skipped.add("registrations skipped", f"{camera}/landmarks: malformed message ({error})")
            return
        self.moments.note(Moment.LANDMARKS_HEARD, camera, matches.stamp_ns)
        if self._missed.add(camera, matches.stamp_ns, matches.previous_stamp_ns):
            reason = f"camera {camera}: the registration before {matches.stamp_ns} ns is lost"
            self.skipped.add("registrations lost", reason)
        self._receive(matches)

    def _on_imu(self, camera: str, message: Message) -> None:
        if self._live.pipeline is not None:
            self._live.pipeline.add_inertial(camera, ImuSamples.from_rows([imu_row(message)]))

    def _on_station(self, seen: SaidSegments) -> None:
        # Who waits for worn cameras does not wait for ever.
        self._first_info_s = self._first_info_s or time.monotonic()
        self._receive(seen)

    def _receive(self, seen: LandmarkMatches | SaidSegments) -> None:
        self._health.heard(seen.stamp_ns)
        if self._started:
            self._add(seen)
        elif len(self._waiting) < self._most_waiting:
            self._waiting.append(seen)
        else:
            self.skipped.add("registrations skipped", "registrations, but no camera_info of the cameras")

    def _add(self, seen: LandmarkMatches | SaidSegments) -> None:
        if isinstance(seen, LandmarkMatches):
            if self._calibration is not None:
                self._calibration.add(seen)
            self._timings.add(seen, self._cameras.models.get(seen.camera))
        begun = self.moments.now()
        self._publish(self._live.add(seen), begun)

    def _look(self) -> None:
        waited_s = time.monotonic() - self._first_info_s if self._first_info_s else 0.0
        if not self._started and self._calibration is None and waited_s > self.parameters.info_wait:
            self._start()
        if self._health.quiet_s > self.parameters.idle_flush:
            self._flush()
        else:
            self._publish(self._live.look())
        if self._live.pipeline is not None:
            self._timings.publish_clocks(self._live.pipeline.synchronizer.clocks.histories)

    def _flush(self) -> int:
        """Publish the instants that wait for later ones; how many there were."""
        outputs = self._live.flush()
        self._publish(outputs)
        return len(outputs)

    def _publish(self, outputs: Sequence[BodyOutput], begun: Instant | None = None) -> None:
        live = self._live
        if live.pipeline is None or live.body is None:
            return
        # First of all: stations look at their next image when they have received it.
        if self._stations is not None:
            self._stations.publish(live.pipeline.lately, live.body)
        for output in outputs:
            self._topics.publish(output, live.body)
            if begun is not None:
                self.moments.note(Moment.SOLVING, "", output.state.stamp_ns, begun)
            self._health.solved(output.state)

    def health(self) -> list[Health]:
        """How the body and its cameras fared in the last second."""
        live = self._live
        health = [*self._health.report(live.pipeline, has_body=live.body is not None), *live.health()]
        return health if self._calibration is None else [*health, self._calibration.health()]


make = partial(StageNode, SolverStage)
"""Makes the node."""
