"""The body of a live graph: made of a file or a range of motion, solved while cameras come, go, and begin anew."""

from collections.abc import Callable, Mapping
from pathlib import Path

from bodycam_ros.body.body_file import read_body
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body_state import BodyOutput, SaidSegments
from bodycam_ros.camera import CameraModel
from bodycam_ros.equipment.coupled_body import coupled_body, held_equipment
from bodycam_ros.equipment.equipment import Equipment
from bodycam_ros.equipment.equipment_report import EquipmentReport
from bodycam_ros.errors import BodyError
from bodycam_ros.live.node_parameters import SolverParameters
from bodycam_ros.messages.health import equipment_health, verdict_health
from bodycam_ros.messages.status import Health
from bodycam_ros.outside.hands import with_hands
from bodycam_ros.outside.placed_body import placed_body
from bodycam_ros.outside.station import Station
from bodycam_ros.outside.station_reports import StationReports
from bodycam_ros.pipeline import SkeletonPipeline
from bodycam_ros.pipeline_settings import PipelineSettings
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.verdict.judge import LiveVerdict


class LiveBody:
    """Solves a body by what is known of its cameras by now.

    Args:
        of: the solver's parameters.
        settings: gives those of all stages as they are now.
        stations: static cameras by name.

    Attributes:
        body: with the equipment; None while it is still to be made.
        equipment: as far as the body can hold it.
        pipeline: that solves; None until cameras are known.
    """

    def __init__(
        self, of: SolverParameters, settings: Callable[[], PipelineSettings], stations: Mapping[str, Station]
    ) -> None:
        self._of, self._settings, self._stations = of, settings, stations
        self._person: BodyModel | None = None
        self._verdict: LiveVerdict | None = None
        self._coupled: EquipmentReport | None = None
        self._flushed = True
        self.body: BodyModel | None = None
        self.equipment: Equipment | None = None
        self.pipeline: SkeletonPipeline | None = None

    def read(self) -> tuple[str, ...]:
        """Read the body file; the cameras that are used.

        Raises:
            BodyError: it cannot be used, or lacks a camera that is asked for.
        """
        path, asked = Path(self._of.body), self._of.cameras
        there = tuple(self.take(read_body(path)).mounts)
        if not self._of.worn:
            return ()
        if not there or not {*asked} <= {*there}:
            unknown = ", ".join(camera for camera in asked if camera not in there)
            raise BodyError(f"{path}: the body has no camera {unknown}; it has {', '.join(there) or 'none'}")
        return tuple(dict.fromkeys(asked)) or there

    def take(self, person: BodyModel) -> BodyModel:
        """There is a person; with the equipment, if any, that is what is solved."""
        person = with_hands(person) if self._stations else person
        # Fitted once: what is left out is reported once.
        self.equipment = held_equipment(self._of.equipment, person) if self._of.equipment else None
        self._person, self.body = person, coupled_body(person, self.equipment)
        return self.body

    def begin(self, cameras: Mapping[str, CameraModel]) -> bool:
        """Solve from nothing with these cameras; whether there is what that takes."""
        if self._person is None or self.body is None or not (cameras or self._stations):
            return False
        self.pipeline = SkeletonPipeline(
            self._person,
            cameras,
            self._settings(),
            live=True,
            on_corrected=self._on_corrected,
            equipment=self.equipment,
            onlookers=self._onlookers(self.body) if self._stations else None,
            stations=self._stations,
            placed=bool(self._of.start),
        )
        self._judge_anew(self.body, cameras)
        return True

    def join(self, camera: str, cameras: Mapping[str, CameraModel]) -> None:
        """The model of a camera has come late, or has become another."""
        if self.pipeline is not None and self.body is not None:
            self.pipeline.join(camera, cameras[camera])
            self._judge_anew(self.body, cameras)

    def add(self, seen: LandmarkMatches | SaidSegments) -> list[BodyOutput]:
        """Add what a camera has seen; the instants that are solved by it."""
        self._flushed = False
        if self.pipeline is None:
            return []
        if isinstance(seen, SaidSegments):
            return self._noted(self.pipeline.add_static(seen))
        return self._noted(self.pipeline.add(seen))

    def look(self) -> list[BodyOutput]:
        """The instants that wait for nobody any more; call it now and then."""
        if self.pipeline is None:
            return []
        self.pipeline.assembler.max_wait_ns = round(1e9 * self._settings().assembler.max_wait)
        return self._noted(self.pipeline.look())

    def flush(self) -> list[BodyOutput]:
        """The instants that wait for later ones."""
        if self._flushed or self.pipeline is None:
            return []
        self._flushed = True
        return self._noted(self.pipeline.flush())

    def health(self) -> list[Health]:
        """How the equipment and the result fare."""
        health = [] if self._coupled is None else [equipment_health(self._coupled)]
        if self._verdict is not None:
            health.append(verdict_health(self._verdict.verdict()))
        return health

    def _onlookers(self, body: BodyModel) -> StationReports:
        of, start, file = self._settings(), self._of.start, Path(self._of.stations)
        placed = placed_body(Path(start), file, self._stations, body, of.region) if start else None
        return StationReports(body, placed, of.region, of.motion)

    def _judge_anew(self, body: BodyModel, cameras: Mapping[str, CameraModel]) -> None:
        # Other cameras or another body: what was seen before is of no use for these.
        of = self._settings()
        self._verdict = LiveVerdict(body, cameras, of.pose_fit)

    def _on_corrected(self, matches: LandmarkMatches) -> None:
        """The verdict compares cameras at the times at which they saw, whatever their clocks show."""
        if self._verdict is not None:
            self._verdict.add_registration(matches)

    def _noted(self, outputs: list[BodyOutput]) -> list[BodyOutput]:
        for output in outputs:
            if self._verdict is not None:
                self._verdict.add_state(output.state.stamp_ns, output.state.world_T_segment)
            # Equipment that nobody saw is bridged.
            self._coupled = output.state.equipment or self._coupled
        return outputs
