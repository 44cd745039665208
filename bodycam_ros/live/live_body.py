"""The body of the live graph: read or calibrated, with its equipment and static cameras, and the pipeline it solves."""

from collections.abc import Callable, Mapping
from pathlib import Path

from bodycam_ros.body.average_person import with_hands
from bodycam_ros.body.body_file import read_body
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.coupled_body import coupled_body, held_equipment
from bodycam_ros.body.equipment import Equipment
from bodycam_ros.body.equipment_report import EquipmentReport
from bodycam_ros.body_state import BodyOutput, SegmentMeasurements
from bodycam_ros.camera import CameraModel
from bodycam_ros.errors import BodyError, StationError
from bodycam_ros.live.camera_diagnostics import verdict_status
from bodycam_ros.live.node_parameters import SolverParameters
from bodycam_ros.live.solver_diagnostics import equipment_status
from bodycam_ros.messages.diagnostics import Status
from bodycam_ros.pipeline import SkeletonPipeline
from bodycam_ros.pipeline_settings import PipelineSettings
from bodycam_ros.quality.judge import LiveVerdict
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.registration.reference_map import load_map
from bodycam_ros.static_cameras.static_measurement import ReportedMeasurement
from bodycam_ros.static_cameras.station import Station
from bodycam_ros.static_cameras.stations_file import read_stations


class LiveBody:
    """Solves a body with the cameras whose models are known by now.

    Args:
        parameters: of the solver.
        settings: returns those of all stages as they are now.
        stations: static cameras by name.

    Attributes:
        body: with the equipment; None until it is calibrated.
        equipment: the part of it that fits the body.
        pipeline: solves; None until cameras are known.
    """

    def __init__(
        self, parameters: SolverParameters, settings: Callable[[], PipelineSettings], stations: Mapping[str, Station]
    ) -> None:
        self._parameters, self._settings, self._stations = parameters, settings, stations
        self._person: BodyModel | None = None
        self._verdict: LiveVerdict | None = None
        self._coupling: EquipmentReport | None = None
        self._is_flushed = True
        self.body: BodyModel | None = None
        self.equipment: Equipment | None = None
        self.pipeline: SkeletonPipeline | None = None

    def read(self) -> tuple[str, ...]:
        """Read the body file; return the names of the cameras to use.

        Raises:
            BodyError: it cannot be used, or lacks a camera that is asked for.
        """
        path, asked = Path(self._parameters.body), self._parameters.cameras
        cameras = tuple(self.set_person(read_body(path)).mounts)
        if not self._parameters.worn:
            return ()
        if not cameras or not {*asked} <= {*cameras}:
            unknown = ", ".join(camera for camera in asked if camera not in cameras)
            raise BodyError(f"{path}: the body has no camera {unknown}; it has {', '.join(cameras) or 'none'}")
        return tuple(dict.fromkeys(asked)) or cameras

    def set_person(self, person: BodyModel) -> BodyModel:
        """Set the person; return the body to solve, which has the equipment too if there is any."""
        person = with_hands(person) if self._stations else person
        given = self._parameters.equipment
        # Fitted once, so that what does not fit is reported once.
        self.equipment = held_equipment(given, person) if given else None
        self._person, self.body = person, coupled_body(person, self.equipment)
        return self.body

    def start(self, cameras: Mapping[str, CameraModel]) -> bool:
        """Start to solve with these cameras, without a past; False if there is no body or no camera."""
        if self._person is None or self.body is None or not (cameras or self._stations):
            return False
        self.pipeline = SkeletonPipeline(
            self._person,
            cameras,
            self._settings(),
            live=True,
            on_corrected=self._judge_registration,
            equipment=self.equipment,
            static_cameras=self._static_measurement(self.body) if self._stations else None,
            stations=self._stations,
            placed=bool(self._parameters.start),
        )
        self._restart_verdict(self.body, cameras)
        return True

    def add_camera(self, camera: str, cameras: Mapping[str, CameraModel]) -> None:
        """Use a camera whose model has arrived late or has changed."""
        if self.pipeline is not None and self.body is not None:
            self.pipeline.join(camera, cameras[camera])
            self._restart_verdict(self.body, cameras)

    def add(self, measured: LandmarkMatches | SegmentMeasurements) -> list[BodyOutput]:
        """Add measurements of a camera; return the states solved with them."""
        self._is_flushed = False
        if self.pipeline is None:
            return []
        return self._judge(self.pipeline.add(measured))

    def add_sample(self, camera: str, stamp_ns: int, reading: tuple[float, ...]) -> list[BodyOutput]:
        """Add a sample of a camera's inertial sensor; return the states solved without images, see the pipeline."""
        if self.pipeline is None:
            return []
        return self._judge(self.pipeline.add_sample(camera, stamp_ns, reading))

    def poll(self) -> list[BodyOutput]:
        """States that do not wait for cameras any more; call it regularly."""
        if self.pipeline is None:
            return []
        self.pipeline.assembler.max_wait_ns = round(1e9 * self._settings().assembler.max_wait)
        return self._judge(self.pipeline.poll())

    def flush(self) -> list[BodyOutput]:
        """States that wait for later ones."""
        if self._is_flushed or self.pipeline is None:
            return []
        self._is_flushed = True
        return self._judge(self.pipeline.flush())

    def report(self) -> list[Status]:
        """Status of the equipment and verdict on the result."""
        statuses = [] if self._coupling is None else [equipment_status(self._coupling)]
        if self._verdict is not None:
            statuses.append(verdict_status(self._verdict.verdict()))
        return statuses

    def _static_measurement(self, body: BodyModel) -> ReportedMeasurement:
        start, file, placed = self._parameters.start, Path(self._parameters.stations), None
        if start:
            from bodycam_ros.formats.read_captured import read_start  # it loads SciPy, which few nodes need

            placed = read_start(Path(start), file, self._stations, body).world_T_segment
        return ReportedMeasurement(body, placed, self._settings().motion)

    def _restart_verdict(self, body: BodyModel, cameras: Mapping[str, CameraModel]) -> None:
        self._verdict = LiveVerdict(body, cameras, self._settings().pose_fit)

    def _judge_registration(self, matches: LandmarkMatches) -> None:
        """Add a registration with its corrected stamp, for the verdict compares cameras at one time."""
        if self._verdict is not None:
            self._verdict.add_registration(matches)

    def _judge(self, outputs: list[BodyOutput]) -> list[BodyOutput]:
        for output in outputs:
            if self._verdict is not None:
                self._verdict.add_state(output.state.stamp_ns, output.state.world_T_segment)
            # Interpolated states have no report.
            self._coupling = output.state.equipment or self._coupling
        return outputs


def read_static_cameras(parameters: SolverParameters) -> dict[str, Station]:
    """Static cameras of the solver in the frame of its map, or of their file without one; empty without ``stations``.

    Raises:
        StationError, LensError, MapError: a file cannot be used, a body is to be calibrated, there is no initial
            estimate of the body, or a parameter of static cameras is given without any.
    """
    stations, start, worn = parameters.stations, parameters.start, parameters.worn
    if not stations:
        if start or not worn:
            given = f"start {start}" if start else "worn false"
            raise StationError(f"{given}: is for static cameras; give their file as the parameter 'stations'")
        return {}
    if parameters.rig:
        raise StationError(
            f"{stations}: static cameras are not used in a range of motion; make the body first, then start again "
            "with 'stations' and without 'rig'"
        )
    if not worn and not start:
        raise StationError(
            f"{stations}: static cameras alone need an initial estimate of the body; place it by hand in a "
            "recording with 'bodycam view --place', and give that as the parameter 'start'"
        )
    reference_map = load_map(Path(parameters.map)) if parameters.map else None
    return read_stations(Path(stations), reference_map)
