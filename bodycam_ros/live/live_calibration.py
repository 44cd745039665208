"""The solver's calibration: it collects a range of motion, and makes a body of it on request (A 4.2)."""

import logging
import math
import threading
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from bodycam_ros.body.body_file import read_body, write_body
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.calibration.body_calibrator import BodyCalibrator, CalibratedBody
from bodycam_ros.calibration.calibration_settings import CalibrationSettings
from bodycam_ros.calibration.report.html_report import write_html_report
from bodycam_ros.calibration.report.report_tables import body_report
from bodycam_ros.calibration.rig import Rig
from bodycam_ros.camera import CameraModel
from bodycam_ros.equipment.equipment import Equipment
from bodycam_ros.errors import BodycamError, BodyError
from bodycam_ros.live.node_parameters import SolverParameters
from bodycam_ros.messages.status import Health, HealthLevel
from bodycam_ros.pipeline_settings import PipelineSettings
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.registration.loaded_map import load_map
from bodycam_ros.registration.reference_map import check_upright

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
            settings.readout,
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
