"""The solver's work without ROS: registrations, images and inertial samples come in, states of the body go out."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
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
from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.camera_image import CameraImage
from bodycam_ros.diagnostics.camera_diagnostics import verdict_status
from bodycam_ros.diagnostics.dropped_messages import DroppedMessages, LostMessages
from bodycam_ros.diagnostics.solver_diagnostics import SolverDiagnostics, equipment_status
from bodycam_ros.errors import BodyError, StaticCameraError
from bodycam_ros.estimation.static_evidence import StaticMeasurement
from bodycam_ros.files.shown import other_than
from bodycam_ros.formats.static_cameras_file import read_static_cameras
from bodycam_ros.graph.map_agreement import MapAgreement
from bodycam_ros.graph.node_parameters import SolverParameters
from bodycam_ros.messages.diagnostics import Status
from bodycam_ros.pipeline.settings import PipelineSettings
from bodycam_ros.pipeline.skeleton import SkeletonPipeline
from bodycam_ros.pipeline.static_cameras import image_measurement
from bodycam_ros.quality.judge import LiveVerdict
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.registration.map_identity import map_identity
from bodycam_ros.registration.reference_map import ReferenceMap, load_map
from bodycam_ros.results.verdict import Verdict
from bodycam_ros.static_cameras.start_file import StaticCameraFiles
from bodycam_ros.static_cameras.static_camera import StaticCamera
from bodycam_ros.static_cameras.static_measurement import ImageMeasurement
from bodycam_ros.timing.clock_state import ClockHistory

if TYPE_CHECKING:
    from bodycam_ros.graph.live_calibration import LiveCalibration


@dataclass(frozen=True)
class SolverOutputs:
    """What is called with the results of a session.

    Attributes:
        body: with a body that is made or exchanged, and its equipment; not with the body file's.
        restarted: with the body, when it is solved without a past.
        state: with each state and its body.
        measured: with the stamp of each static camera's image [ns], and what was measured in them.
    """

    body: Callable[[BodyModel, Equipment | None], object]
    restarted: Callable[[BodyModel], object]
    state: Callable[[BodyOutput, BodyModel], object]
    measured: Callable[[Mapping[str, int], StaticMeasurement], None]


class SolverSession:
    """Solves one body live; with a rig it has none until one is made of a range of motion.

    It restarts where the time of most cameras goes back, and where most registrations are in another map than before.
    Registrations in another map than most are left out.

    Args:
        given: parameters of the solver.
        settings: of all stages.
        outputs: receive the results.
        dropped: counts messages that could not be used.

    Attributes:
        cameras: names of the cameras on the body.
        stations: static cameras by name.
        calibration: collects a range of motion; None without a rig.
        body: to solve, with its equipment; None while there is none.

    Raises:
        BodycamError: a file or a parameter cannot be used.
    """

    def __init__(
        self, given: SolverParameters, settings: PipelineSettings, outputs: SolverOutputs, dropped: DroppedMessages
    ) -> None:
        self.given, self.settings = given, settings
        self._outputs, self._dropped = outputs, dropped
        settings.estimator.check_live()
        equipment = read_equipment(given.equipment) if given.equipment else None
        self.has_equipment = equipment is not None
        reference_map, self.stations = _read_static_cameras(given)
        self._maps = MapAgreement(None if reference_map is None else map_identity(reference_map))
        self._static_cameras: ImageMeasurement | None = None
        self._person: BodyModel | None = None
        self.body: BodyModel | None = None
        self.equipment: Equipment | None = None  # the part of it that fits the person
        self._coupling: EquipmentReport | None = None
        self._pipeline: SkeletonPipeline | None = None
        self._models: Mapping[str, CameraModel] = {}
        self._verdict: LiveVerdict | None = None
        self._is_flushed = True
        self._lost = LostMessages()
        self.calibration: LiveCalibration | None = None
        if given.rig:
            from bodycam_ros.graph import live_calibration  # it loads matplotlib

            self.calibration = live_calibration.LiveCalibration(given, equipment)
        self.cameras = self._read_body() if self.calibration is None else self.calibration.cameras
        self._diagnostics = SolverDiagnostics(dropped, given.body_cameras)

    @property
    def clocks(self) -> Mapping[str, ClockHistory]:
        """Camera -> its clock, as far as it is known."""
        return {} if self._pipeline is None else self._pipeline.clocks.histories

    def start(self) -> None:
        """Solve without a past, if there is a body."""
        person, body = self._person, self.body
        if person is None or body is None:
            return
        self._pipeline = SkeletonPipeline(
            person,
            self.cameras,
            self.settings,
            live=True,
            on_corrected=self._judge_registration,
            equipment=self.equipment,
            static_cameras=self._static_cameras,
            stations=self.stations,
        )
        self._restart_verdict()
        self._outputs.restarted(body)

    def set_models(self, models: Mapping[str, CameraModel], are_complete: bool) -> None:
        """Judge by the present models; start to collect a range of motion once they are complete."""
        self._models = models
        if self.calibration is not None and are_complete:
            self.calibration.start(models, self.settings)
        self._restart_verdict()

    def add_registration(self, matches: LandmarkMatches) -> None:
        """Add a registration, unless it is in another map than the body."""
        camera = matches.camera
        stamp_ns = matches.stamp_ns
        before = self._maps.identity
        if self._lost.add(camera, stamp_ns, matches.previous_stamp_ns):
            reason = f"camera {camera}: the registration before {stamp_ns} ns is lost"
            self._dropped.add("registrations lost", reason)
        self._diagnostics.add_registration(camera, stamp_ns, matches.world_T_camera is not None)
        if not self._maps.add(matches, time.monotonic()):
            reason = (
                f"camera {camera}: registered in map {matches.map_identity}, the body in map {before}; it is not used"
            )
            self._dropped.add("registrations in another map", reason)
            return
        if before is not None and before.contradicts(self._maps.identity or before):
            reason = (
                f"most cameras are registered in map {self._maps.identity} now, before in {before}; the body restarts"
            )
            self._dropped.add("changes of the map", reason)
            self.flush()
            self.start()
            if self.calibration is not None:
                self.calibration.restart()  # what was collected is of the other map
        if self.calibration is not None:
            self.calibration.add(matches)
        self._add(matches)

    def add_static(self, image: CameraImage) -> bool:
        """Add an image of a static camera, which is always used."""
        self._diagnostics.add_registration(image.camera, image.stamp_ns, is_registered=False)
        self._add(image)
        return True

    def add_sample(self, camera: str, stamp_ns: int, reading: tuple[float, ...]) -> None:
        """Add a sample of a camera's inertial sensor, as ``SkeletonPipeline.add_sample``."""
        if self._pipeline is not None:
            self._publish(self._pipeline.add_sample(camera, stamp_ns, reading))

    def add_image(self, camera: str, stamp_ns: int) -> None:
        """Note that an image was taken, whose registration is still to come."""
        self._diagnostics.add_image(camera, stamp_ns)
        if self._pipeline is not None:
            self._pipeline.add_image(stamp_ns)

    def poll(self) -> None:
        """Publish what waits for cameras that have been silent for long; call it regularly."""
        if self._pipeline is None:
            return
        if self._diagnostics.quiet_s > self.given.idle_flush:
            self.flush()
        else:
            self._pipeline.arrivals.set_max_wait(self.settings.assembler.max_wait)
            self._publish(self._pipeline.poll())

    def poll_calibration(self) -> None:
        """Solve the body that a calibration has made by now; call it regularly."""
        if self.calibration is not None:
            self._set_person(self.calibration.poll())

    def pause(self) -> None:
        """Publish the frames that wait for later ones, and cancel a calibration."""
        if self.calibration is not None:
            self._set_person(self.calibration.stop())
        self.flush()
        self._lost = LostMessages()

    def flush(self) -> int:
        """Publish the frames that wait for later ones; return their number."""
        if self._is_flushed or self._pipeline is None:
            return 0
        self._is_flushed = True
        outputs = self._pipeline.flush()
        self._publish(outputs)
        return len(outputs)

    def reset(self) -> str:
        """Forget the motion, the clocks and the cameras; return what was done."""
        flushed = self.flush()
        self._lost = LostMessages()
        self.start()
        return f"{flushed} frames published; the body restarts"

    def verdict(self) -> Verdict | None:
        """Verdict on the last seconds, and on the maps; None while there is no body."""
        if self._verdict is None:
            return None
        of_maps = [*self._maps.findings(time.monotonic())]
        return Verdict.from_findings((*of_maps, *self._verdict.verdict().findings))

    def report(self) -> list[Status]:
        """Status of the body, of its cameras and of what it was made from, since the last report."""
        statuses = self._diagnostics.report(self._pipeline)
        statuses += [] if self._coupling is None else [equipment_status(self._coupling)]
        statuses += [] if (verdict := self.verdict()) is None else [verdict_status(verdict)]
        return statuses if self.calibration is None else [*statuses, self.calibration.report()]

    def _read_body(self) -> tuple[str, ...]:
        """Read the body file; return the names of the cameras to use.

        Raises:
            BodyError: it cannot be used, or lacks a camera that is asked for.
        """
        path, asked = Path(self.given.body), self.given.cameras
        cameras = tuple(self._use_person(read_body(path)).mounts)
        if not self.given.body_cameras:
            return ()
        if not cameras or not {*asked} <= {*cameras}:
            unknown = next((camera for camera in asked if camera not in cameras), "")
            raise BodyError(f"{path}: the body has no camera {unknown}; {other_than(unknown, cameras)}")
        return tuple(dict.fromkeys(asked)) or cameras

    def _use_person(self, person: BodyModel) -> BodyModel:
        """Set the person; return the body to solve, which has the equipment too if there is any."""
        given = self.given
        person = with_hands(person) if self.stations else person
        # Fitted once, so that what does not fit is reported once.
        self.equipment = held_equipment(given.equipment, person) if given.equipment else None
        self._person, self.body = person, coupled_body(person, self.equipment)
        if self.stations:
            surface, start = (Path(name) if name else None for name in (given.surface, given.start))
            files, path = StaticCameraFiles(Path(given.stations), surface, start), Path(given.body)
            self._static_cameras = image_measurement(
                files, self.stations, self.body, path, self.settings, self._outputs.measured, live=True
            )
        return self.body

    def _set_person(self, person: BodyModel | None) -> None:
        """Solve a new body, if there is one, from the next registrations on."""
        if person is not None:
            self.flush()
            body = self._use_person(person)
            self.start()
            self._outputs.body(body, self.equipment)

    def _restart_verdict(self) -> None:
        if self.body is not None:
            self._verdict = LiveVerdict(self.body, self._models, self.settings.pose_fit)

    def _judge_registration(self, matches: LandmarkMatches) -> None:
        """Add a registration with its corrected stamp, for the verdict compares cameras at one time."""
        if self._verdict is not None:
            self._verdict.add_registration(matches)

    def _add(self, measured: LandmarkMatches | CameraImage) -> None:
        self._is_flushed = False
        if self._pipeline is not None:
            self._publish(self._pipeline.add(measured))

    def _publish(self, outputs: Sequence[BodyOutput]) -> None:
        body = self.body
        if body is None:
            return
        for output in outputs:
            if self._verdict is not None:
                self._verdict.add_state(output.state.stamp_ns, output.state.world_T_segment)
            # Interpolated states have no report.
            self._coupling = output.state.equipment or self._coupling
            self._outputs.state(output, body)
            self._diagnostics.add_state(output.state)


def _read_static_cameras(parameters: SolverParameters) -> tuple[ReferenceMap | None, dict[str, StaticCamera]]:
    """The map whose frame is the world, and static cameras in it; none without ``stations``.

    Raises:
        StaticCameraError, LensError, MapError: a file cannot be used, a body is to be calibrated, there is no initial
            estimate of the body, or a parameter of static cameras is given without any.
    """
    stations, start, body_cameras = parameters.stations, parameters.start, parameters.body_cameras
    if not stations:
        if start or not body_cameras:
            given = f"start {start}" if start else "body_cameras false"
            raise StaticCameraError(f"{given}: is for static cameras; give their file as the parameter 'stations'")
        return None, {}
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
    return reference_map, read_static_cameras(Path(stations), reference_map)
