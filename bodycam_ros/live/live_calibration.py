"""The solver's calibration: it collects a range of motion, and makes a body of it on request (A 4.2)."""

import logging
import math
import threading
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

from bodycam_ros.body.body_file import read_body, write_body
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.coupled_body import coupled_body, held_equipment
from bodycam_ros.body.equipment import Equipment
from bodycam_ros.body.equipment_report import EquipmentReport
from bodycam_ros.body_state import BodyOutput, SaidSegments
from bodycam_ros.calibration.body_calibrator import BodyCalibrator, CalibratedBody, CalibrationSettings
from bodycam_ros.calibration.rig import Rig
from bodycam_ros.camera import CameraModel
from bodycam_ros.errors import BodycamError, BodyError
from bodycam_ros.formats.read_captured import read_joint_points
from bodycam_ros.live.node_parameters import SolverParameters
from bodycam_ros.messages.health import Health, HealthLevel, equipment_health, verdict_health
from bodycam_ros.pipeline import SkeletonPipeline
from bodycam_ros.pipeline_settings import PipelineSettings
from bodycam_ros.plots.body_report import write_html_report
from bodycam_ros.plots.report_tables import body_report
from bodycam_ros.quality.judge import LiveVerdict
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.registration.reference_map import check_upright, load_map
from bodycam_ros.static_cameras.person_model import with_hands
from bodycam_ros.static_cameras.start_file import placed_body
from bodycam_ros.static_cameras.static_measurement import ReportedMeasurement
from bodycam_ros.static_cameras.station import Station

logger = logging.getLogger(__name__)

_STOP_S = 5.0


class LiveCalibration:
    """Collects registrations, and makes the body of them beside the live work.

    Neither success nor failure ends the collecting: who has not moved a joint enough moves it and asks again.

    Args:
        of: the solver's parameters.
        equipment: that it was given; None without.

    Attributes:
        path: body YAML to be.
        cameras: the rig's.

    Raises:
        BodyError: the rig cannot be read, the body is there already and is not to be overwritten or cannot be written
            there, or a parameter does not go with a range of motion.
        MapError: the map has no scale or no vertical.
    """

    def __init__(self, of: SolverParameters, equipment: Equipment | None) -> None:
        self.path = path = Path(of.body)
        self._rig = Rig.from_yaml(of.rig)
        if equipment is not None and equipment.mounts:
            raise BodyError(
                f"equipment {equipment.name}: carries {', '.join(equipment.mounts)}, which a range of motion does not "
                "need; make the body first, then start again with 'equipment' and without 'rig'"
            )
        if of.cameras:
            raise BodyError(f"{path}: a calibration needs all cameras of the rig, so leave out the parameter 'cameras'")
        if path.exists() and not of.overwrite_body:
            raise BodyError(
                f"{path}: is there already, and with a 'rig' it would be replaced; to allow that give "
                "-p overwrite_body:=true, to use it as it is leave out 'rig'"
            )
        if not path.parent.is_dir():
            raise BodyError(f"{path}: its folder is not there; make it first")
        if not of.map:
            raise BodyError("the parameter 'map' is missing: a calibration needs its scale and its vertical")
        check_upright(load_map(Path(of.map)), Path(of.map))
        self.cameras = tuple(self._rig.cameras)
        self._facing = None if math.isnan(of.facing) else math.radians(of.facing)
        self._calibrator: BodyCalibrator | None = None
        self._making: BodyInTheMaking | None = None
        self._collected = 0
        self._failure = ""

    @property
    def is_running(self) -> bool:
        """Whether a body is being made."""
        return self._making is not None

    def begin(
        self, cameras: Mapping[str, CameraModel], settings: PipelineSettings, calibration: CalibrationSettings
    ) -> None:
        """Collect from now on; raises RangeOfMotionError if one of the rig's cameras is not among the models."""
        self._collected = 0
        self._calibrator = BodyCalibrator(
            self._rig,
            cameras,
            calibration,
            settings.pose_fit,
            settings.evidence,
            self._facing,
            settings.clock,
        )

    def add(self, matches: LandmarkMatches) -> None:
        """Collect a registration."""
        if self._calibrator is not None:
            self._calibrator.add(matches)
            self._collected += 1

    def collect_anew(self) -> tuple[bool, str]:
        """Forget what has been collected; whether that could be, and what to do."""
        if self._making is not None:
            return False, "a calibration is running; call again when it has ended"
        if self._calibrator is not None:
            self._calibrator.forget()
        self._collected, self._failure = 0, ""
        return True, "collecting anew; begin with the N-pose, standing still, then go through the range of motion"

    def make(self) -> "BodyInTheMaking":
        """Make a body of what has been collected so far.

        Raises:
            BodyError: the camera_info of a camera is missing.
        """
        if self._calibrator is None:
            raise BodyError(f"there is no camera_info yet of all of the rig's cameras {', '.join(self.cameras)}")
        if self._making is None or self._making.is_cancelled:
            self._making = BodyInTheMaking(self._calibrator, self.path, self._making)
        return self._making

    def look(self) -> BodyModel | None:
        """The new body, once; call it now and then."""
        if self._making is None or self._making.is_alive():
            return None
        done, self._making = self._making, None
        if not done.is_cancelled:
            self._failure = "" if done.body is not None else done.text
            (logger.warning if done.body is not None else logger.error)("%s", done.text)
        return done.body

    def stop(self) -> BodyModel | None:
        """Cancel what is being made; a body that is being written already is waited for."""
        if self._making is not None and not self._making.cancel():
            self._making.join(_STOP_S)
        return self.look()

    def health(self) -> Health:
        """How far it is."""
        values: dict[str, object] = {"registrations collected": self._collected}
        if self._making is not None:
            values |= {"step": self._making.step, "done [%]": round(100 * self._making.share)}
            return Health("calibration", HealthLevel.OK, "calibrating", values)
        if self._failure:
            return Health("calibration", HealthLevel.WARN, self._failure, values)
        return Health("calibration", HealthLevel.OK, "collecting", values)


class _Stopped(Exception):
    """Nobody needs the result any more."""


class BodyInTheMaking(threading.Thread):
    """Makes the body of what was collected, and writes it and its report; starts at once.

    Args:
        calibrator: may collect further in the meantime.
        path: of the body file; the report goes beside it. Both are replaced only by a body that is complete.
        before: one that was cancelled, and has to end first.

    Attributes:
        step, share: as of ``Work``.
        is_cancelled: whether it was, before it wrote anything.
        body: once the thread has ended, the body; None after an error.
        text: once the thread has ended, a summary or the error.
    """

    def __init__(self, calibrator: BodyCalibrator, path: Path, before: threading.Thread | None = None) -> None:
        super().__init__(name="calibration", daemon=True)
        self._calibrator, self._path, self._before = calibrator, path, before
        self._turn = threading.Lock()
        self._is_writing = self.is_cancelled = False
        self.step, self.share = "start", 0.0
        self.body: BodyModel | None = None
        self.text = ""
        self.start()

    @property
    def result(self) -> tuple[bool, str] | None:
        """As of ``Work``."""
        if self.is_cancelled:
            return False, "cancelled; nothing was written"
        return None if self.is_alive() else (self.body is not None, self.text)

    def cancel(self) -> bool:
        """As of ``Work``; it is too late once the files are being written."""
        with self._turn:
            self.is_cancelled = not self._is_writing
            return self.is_cancelled

    def run(self) -> None:
        """Do the work; for ``start``."""
        try:
            if self._before is not None:
                self._before.join()
            calibrated = self._calibrator.solve(self._path.stem, self._on_progress)
            self._on_progress("report", 0.0, is_writing=True)
            body = replace(calibrated.body, report=body_report(calibrated.diagnosis))
            write_html_report(body, calibrated.diagnosis, self._path.with_suffix(".html"))
            write_body(body, self._path)
            self.text = _summary(self._path, calibrated)
            # As the file has it, which rounds, so that a replay with the file gives the same.
            self.body = read_body(self._path)
        except BodycamError as error:
            self.text = str(error)
        except _Stopped:
            pass
        except Exception as error:
            self.text = f"the calibration broke down ({type(error).__name__}: {error}); the node's log has the place"
            logger.exception("calibration")

    def _on_progress(self, step: str, share: float, is_writing: bool = False) -> None:
        with self._turn:
            if self.is_cancelled:
                raise _Stopped
            self._is_writing = is_writing
        self.step, self.share = step, share


def _summary(path: Path, calibrated: CalibratedBody) -> str:
    diagnosis = calibrated.diagnosis
    text = f"{path} written: {len(diagnosis.joints)} joints and {len(diagnosis.cameras)} cameras"
    if diagnosis.refinement is not None:
        text += f", reprojection error {diagnosis.refinement.after_px:.2f} px"
    if diagnosis.warnings:
        text += f"; look at: {'; '.join(diagnosis.warnings)}"
    return text


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
            static_cameras=self._static_cameras(self.body) if self._stations else None,
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

    def _static_cameras(self, body: BodyModel) -> ReportedMeasurement:
        of, start, file = self._settings(), self._of.start, Path(self._of.stations)
        placed = (
            placed_body(Path(start), file, self._stations, body, read_joint_points(Path(start))).world_T_segment
            if start
            else None
        )
        return ReportedMeasurement(body, placed, of.motion)

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
