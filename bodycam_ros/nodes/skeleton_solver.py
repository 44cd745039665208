"""Node ``skeleton_solver``: the registrations of all cameras in, the articulated body out (A 4.3).

With a rig instead of a body it first makes the body, from a range of motion (A 4.2).
"""

import time
from collections.abc import Iterable, Sequence
from functools import partial
from pathlib import Path

from bodycam_ros.body.body_file import read_body
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.calibration.calibration_settings import CalibrationSettings
from bodycam_ros.equipment.coupled_body import coupled_body, held_equipment
from bodycam_ros.equipment.equipment import Equipment
from bodycam_ros.equipment.equipment_report import EquipmentReport
from bodycam_ros.equipment.equipment_yaml import read_equipment
from bodycam_ros.errors import BodyError
from bodycam_ros.live.flow_of_frames import MissedFrames
from bodycam_ros.live.live_calibration import LiveCalibration
from bodycam_ros.live.node_parameters import SOLVER_GROUPS, SolverParameters
from bodycam_ros.live.solver_health import SolverHealth
from bodycam_ros.live.static_cameras import stations_of_solver
from bodycam_ros.live.work import Work
from bodycam_ros.messages.factory import Message
from bodycam_ros.messages.health import equipment_health, verdict_health
from bodycam_ros.messages.status import Health
from bodycam_ros.messages.tracks import landmark_matches
from bodycam_ros.moments import Instant, Moment
from bodycam_ros.nodes.body_topics import BodyTopics
from bodycam_ros.nodes.camera_timings import CameraTimings
from bodycam_ros.nodes.camera_topics import CameraModels
from bodycam_ros.nodes.qos import STAGE_DEPTH, reliable
from bodycam_ros.nodes.stage_node import Stage, StageNode
from bodycam_ros.nodes.stations import Stations
from bodycam_ros.outside.hands import with_hands
from bodycam_ros.pipeline import SkeletonPipeline
from bodycam_ros.pipeline_settings import PipelineSettings
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.solving.body_state import BodyOutput
from bodycam_ros.solving.said_segments import SaidSegments
from bodycam_ros.verdict.judge import LiveVerdict

_LOOK_S, _CALIBRATION_LOOK_S = 0.5, 0.2


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
        self.settings.smoother.check_live()
        self._equipment = read_equipment(of.equipment) if of.equipment else None
        self._topics = BodyTopics(self, with_equipment=self._equipment is not None)
        self._held: Equipment | None = None
        self._coupled: EquipmentReport | None = None
        self._person: BodyModel | None = None
        self._body: BodyModel | None = None
        self._calibration: LiveCalibration | None = None
        stations = stations_of_solver(of)
        self._stations = Stations(self, stations, self._on_said) if stations else None
        path = Path(self.required("body"))
        carried = self._prepare_calibration() if of.rig else self._read_body(path)
        self._pipeline: SkeletonPipeline | None = None
        self._verdict: LiveVerdict | None = None
        self._started = False
        self._waiting: list[LandmarkMatches | SaidSegments] = []
        self._most_waiting = STAGE_DEPTH * (len(carried) + len(self._stations.stations if self._stations else ()))
        self._missed = MissedFrames()
        self._first_info_s: float | None = None
        self._flushed = True
        self._timings = CameraTimings(self, carried)
        for camera in carried:
            heard = partial(self._on_landmarks, camera)
            self.subscription("bodycam_msgs/msg/LandmarkMatches", f"{camera}/landmarks", heard, reliable(STAGE_DEPTH))
        self._is_described = False
        self.trigger("~/flush", lambda: (True, f"{self._flush()} instants published"))
        self.trigger("~/reset", self._reset)
        # The last: who sees it reading camera_info may take it that it reads the rest.
        self._cameras = CameraModels(self, carried, self._on_camera)
        self._health = SolverHealth(self._cameras, self.skipped)
        if not carried:
            self._start()
        self.every(_LOOK_S, self._look)

    def begin(self) -> None:
        """Say what body it is."""
        if self._body is not None and not self._is_described:
            self._describe(self._body)

    def pause(self) -> None:
        """Publish what waits for later instants, for these do not come; a body that is being made is given up."""
        if self._calibration is not None:
            self._take_body(self._calibration.stop())
        if self.node.action is not None:
            self.node.action.stop()
        self._flush()
        self._forget_heard()

    def _reset(self) -> tuple[bool, str]:
        """What was learned of the motion, the clocks and the cameras is dropped."""
        flushed = self._flush()
        self._forget_heard()
        if self._pipeline is not None:
            self._solve_with_those_known()
        return True, f"{flushed} instants published; the body begins anew"

    def _forget_heard(self) -> None:
        self._waiting.clear()
        self._missed = MissedFrames()

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

    def finish(self) -> None:
        """The same, and wait until readers have received it."""
        self.pause()
        self._topics.finish()

    def _read_body(self, path: Path) -> tuple[str, ...]:
        """Learn the body that is there; its cameras, as far as they are listened to."""
        asked, there = self.parameters.cameras, tuple(self._know(read_body(path)).mounts)
        if not self.parameters.worn:
            return ()
        if not there or not {*asked} <= {*there}:
            unknown = ", ".join(camera for camera in asked if camera not in there)
            raise BodyError(f"{path}: the body has no camera {unknown}; it has {', '.join(there) or 'none'}")
        return tuple(dict.fromkeys(asked)) or there

    def _know(self, person: BodyModel) -> BodyModel:
        """There is a body; with the equipment, if any, it is what is solved and published."""
        person = with_hands(person) if self._stations else person
        # Fitted once: what is left out is told once.
        self._held = held_equipment(self.parameters.equipment, person) if self.parameters.equipment else None
        self._person, self._body = person, coupled_body(person, self._held)
        return self._body

    def _describe(self, body: BodyModel) -> None:
        self._is_described = True
        self._topics.describe(body, self._held)

    def _prepare_calibration(self) -> tuple[str, ...]:
        """Be ready to make the body; the rig's cameras."""
        calibration = self._calibration = LiveCalibration(self.parameters, self._equipment)
        self.trigger("~/calibrate", self._calibrate)
        self.trigger("~/start_calibration", calibration.collect_anew)
        self.every(_CALIBRATION_LOOK_S, lambda: self._take_body(calibration.look()), even_inactive=True)
        return calibration.cameras

    def _on_camera(self, camera: str) -> None:
        self._first_info_s = self._first_info_s or time.monotonic()
        if self._started:
            self._join(camera)
        elif not self._cameras.missing:
            self._start()

    def _join(self, camera: str) -> None:
        """A camera's model has come late, or has become another."""
        if self._calibration is not None and not self._calibration.is_running:
            self._collect(self._calibration)
        model = self._cameras.models.get(camera)
        if model is None:
            return
        if self._pipeline is not None:
            self._pipeline.join(camera, model)
            self._judge_anew()
        else:
            self._solve_with_those_known()

    def _start(self) -> None:
        """Enough cameras are known: from now on they are collected, or the body is solved, or both."""
        self._started = True
        if self._calibration is not None:
            self._collect(self._calibration)
        for camera in self._cameras.missing:
            self.log.warning(f"there is no {camera}/camera_info yet; the camera joins when it comes")
        self._solve_with_those_known()
        for heard in self._waiting:
            self._take(heard)
        self._waiting.clear()

    def _solve_with_those_known(self) -> None:
        if self._person is not None and self._body is not None and (self._cameras.models or self._stations):
            self._pipeline = SkeletonPipeline(
                self._person,
                self._cameras.models,
                self.settings,
                live=True,
                on_corrected=self._on_corrected,
                equipment=self._held,
                onlookers=self._stations.reports(self._body) if self._stations else None,
                stations=self._stations.stations if self._stations else (),
                placed=bool(self.parameters.start),
            )
            self._timings.begin(self._body)
            self._judge_anew()

    def _judge_anew(self) -> None:
        # Other cameras or another body: what was seen before says nothing of them.
        if self._body is not None:
            self._verdict = LiveVerdict(self._body, self._cameras.models, self.settings.verdict, self.settings.pose_fit)

    def _collect(self, calibration: LiveCalibration) -> None:
        calibration.begin(self._cameras.models, self.settings, self.node.parameters.of(CalibrationSettings))

    def _take_body(self, body: BodyModel | None) -> None:
        """If there is a new body, the registrations from now on are its own."""
        if body is None:
            return
        self._flush()
        coupled = self._know(body)
        self._solve_with_those_known()
        self._describe(coupled)

    def _take(self, heard: LandmarkMatches | SaidSegments) -> None:
        if isinstance(heard, LandmarkMatches):
            if self._calibration is not None:
                self._calibration.add(heard)
            self._timings.add(heard, self._cameras.models.get(heard.camera))
        if self._pipeline is not None:
            begun = self.moments.now()
            said = self._pipeline.add_static(heard) if isinstance(heard, SaidSegments) else self._pipeline.add(heard)
            self._publish(said, begun)

    def _on_corrected(self, matches: LandmarkMatches) -> None:
        """The verdict compares cameras at the times at which they saw, whatever their clocks say."""
        if self._verdict is not None:
            self._verdict.add_registration(matches)

    def _on_landmarks(self, camera: str, message: Message) -> None:
        try:
            matches = landmark_matches(message, camera)
        except ValueError as error:
            self.skipped.add("registrations skipped", f"{camera}/landmarks: malformed message ({error})")
            return
        self.moments.note(Moment.LANDMARKS_HEARD, camera, matches.stamp_ns)
        if self._missed.add(camera, matches.stamp_ns, matches.previous_stamp_ns):
            self.skipped.add(
                "registrations lost", f"camera {camera}: the registration before {matches.stamp_ns} ns is lost"
            )
        self._hear(matches)

    def _on_said(self, said: SaidSegments) -> None:
        # Who waits for worn cameras does not wait for ever.
        self._first_info_s = self._first_info_s or time.monotonic()
        self._hear(said)

    def _hear(self, heard: LandmarkMatches | SaidSegments) -> None:
        self._health.heard(heard.stamp_ns)
        self._flushed = False
        if self._started:
            self._take(heard)
        elif len(self._waiting) < self._most_waiting:
            self._waiting.append(heard)
        else:
            self.skipped.add("registrations skipped", "registrations, but no camera_info of the cameras")

    def _look(self) -> None:
        waited_s = time.monotonic() - self._first_info_s if self._first_info_s else 0.0
        if not self._started and self._calibration is None and waited_s > self.parameters.info_wait:
            self._start()
        if self._health.quiet_s > self.parameters.idle_flush:
            self._flush()
        elif self._pipeline is not None:
            self._publish(self._pipeline.look())
        if self._pipeline is not None:
            self._pipeline.assembler.max_wait_ns = round(1e9 * self.settings.assembler.max_wait)
            self._timings.publish_clocks(self._pipeline.instants.watch.timings)

    def _flush(self) -> int:
        """Publish the instants that wait for later ones; how many there were."""
        if self._flushed or self._pipeline is None:
            return 0
        self._flushed = True
        outputs = self._pipeline.flush()
        self._publish(outputs)
        return len(outputs)

    def _publish(self, outputs: Iterable[BodyOutput], begun: Instant | None = None) -> None:
        # First of all: stations look at their next image when they have heard it.
        if self._stations is not None and self._pipeline is not None and self._body is not None:
            self._stations.tell(self._pipeline.lately, self._body)
        for output in outputs:
            if self._body is not None:
                self._topics.publish(output, self._body)
                if begun is not None:
                    self.moments.note(Moment.SOLVING, "", output.state.stamp_ns, begun)
            if self._verdict is not None:
                self._verdict.add_state(output.state.stamp_ns, output.state.world_T_segment)
            self._health.solved(output.state)
            # What nobody saw is bridged, and says nothing of equipment.
            self._coupled = output.state.equipment or self._coupled

    def health(self) -> list[Health]:
        """How the body and its cameras fared in the last second."""
        health = self._health.report(self._pipeline, has_body=self._body is not None)
        if self._coupled is not None:
            health.append(equipment_health(self._coupled))
        if self._verdict is not None:
            self._verdict.settings = self.settings.verdict
            health = [*health, verdict_health(self._verdict.verdict())]
        return health if self._calibration is None else [*health, self._calibration.health()]


def make(arguments: Sequence[str] = ()) -> StageNode[SolverParameters]:
    """The node."""
    return StageNode(SolverStage, arguments)
