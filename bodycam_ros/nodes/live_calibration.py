"""The solver's calibration: it collects a range of motion, and makes a body of it on request."""

import math
import threading
import traceback
from collections.abc import Callable, Mapping
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
from bodycam_ros.nodes.stage_node import Stage
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.registration.loaded_map import load_map
from bodycam_ros.registration.reference_map import check_upright

CALIBRATE_TYPE = "bodycam_msgs/action/Calibrate"
_LOOK_S = 0.2
_STOP_S = 5.0


class LiveCalibration:
    """Collects from the start, or from the latest ``~/start_calibration``; ``~/calibrate`` makes the body.

    The action ``~/calibrate`` has progress and an answer, and can be cancelled; the service of that name begins the
    same work and returns. Neither success nor failure ends the collecting: who has not moved a joint enough moves it
    and asks again.

    Args:
        stage: the solver.
        equipment: that it was given; None without.
        path: body YAML to write.
        on_body: called with each new body.

    Raises:
        BodyError: the rig cannot be read, the body is there already and is not to be overwritten or cannot be written
            there, or a parameter does not go with a range of motion.
        MapError: the map has no scale or no vertical.
        SettingsError: no map is named.
    """

    def __init__(
        self,
        stage: Stage[SolverParameters],
        equipment: Equipment | None,
        path: Path,
        on_body: Callable[[BodyModel], None],
    ) -> None:
        of = stage.parameters
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
        map_path = Path(stage.required("map"))
        check_upright(load_map(map_path), map_path)
        self._stage, self._path, self._on_body = stage, path, on_body
        self._calibrator: BodyCalibrator | None = None
        self._thread: _Calibrating | None = None
        self._cancelled: _Calibrating | None = None
        self._collected = 0
        self._is_asked = False
        self._failure = ""
        stage.trigger("~/calibrate", self._calibrate)
        stage.trigger("~/start_calibration", self._collect_anew)
        stage.every(_LOOK_S, self._look, even_inactive=True)

    @property
    def cameras(self) -> tuple[str, ...]:
        """The rig's."""
        return tuple(self._rig.cameras)

    @property
    def is_running(self) -> bool:
        """Whether a body is being made."""
        return self._thread is not None

    def begin(self, cameras: Mapping[str, CameraModel]) -> None:
        """Collect from now on; raises RangeOfMotionError if one of the rig's cameras is not among the models."""
        self._collected = 0
        settings, facing_deg = self._stage.settings, self._stage.parameters.facing
        self._calibrator = BodyCalibrator(
            self._rig,
            cameras,
            self._stage.node.parameters.of(CalibrationSettings),
            settings.pose_fit,
            settings.evidence,
            None if math.isnan(facing_deg) else math.radians(facing_deg),
            settings.clock,
            settings.readout,
        )

    def add(self, matches: LandmarkMatches) -> None:
        """Collect a registration."""
        if self._calibrator is not None:
            self._calibrator.add(matches)
            self._collected += 1

    def make(self) -> None:
        """Make a body of what has been collected so far.

        Raises:
            BodyError: the camera_info of a camera is missing.
        """
        if self._calibrator is None:
            raise BodyError(f"there is no camera_info yet of all of the rig's cameras {', '.join(self.cameras)}")
        self._is_asked = True
        self._look()

    def cancel(self) -> bool:
        """Cancel what is being made, which costs nothing that was there; False if it is too late for that."""
        if not self._give_up():
            return False
        # Not here: a goal is cancelled only after this has returned.
        self._stage.soon(lambda: self._answer(False, "cancelled; nothing was written"), even_inactive=True)
        return True

    def stop(self) -> None:
        """Cancel what is being made; a body that is being written already is waited for."""
        if not self._give_up() and self._thread is not None:
            self._thread.join(_STOP_S)
            self._look()
        self._answer(False, "the node was stopped")

    def health(self) -> Health:
        """How far it is."""
        values: dict[str, object] = {"registrations collected": self._collected}
        if self._thread is not None:
            values |= {"step": self._thread.step, "done [%]": round(100 * self._thread.share)}
            return Health("calibration", HealthLevel.OK, "calibrating", values)
        if self._failure:
            return Health("calibration", HealthLevel.WARN, self._failure, values)
        return Health("calibration", HealthLevel.OK, "collecting", values)

    def _calibrate(self) -> tuple[bool, str]:
        if not self._stage.node.is_active:
            return False, "the node is inactive; activate it first"
        self.make()
        return True, f"makes {self._path}; /diagnostics has the progress and the node's log the result"

    def _collect_anew(self) -> tuple[bool, str]:
        if self._thread is not None:
            return False, "a calibration is running; call again when it has ended"
        if self._calibrator is not None:
            self._calibrator.forget()
        self._collected, self._failure = 0, ""
        return True, "collecting anew; begin with the N-pose, standing still, then go through the range of motion"

    def _give_up(self) -> bool:
        self._is_asked = False
        if self._thread is not None and not self._thread.give_up():
            return False
        self._cancelled, self._thread = self._thread or self._cancelled, None
        return True

    def _answer(self, success: bool, text: str) -> None:
        if self._stage.node.action is not None:
            self._stage.node.action.answer(success, text)

    def _look(self) -> None:
        """Take what is done, and begin what is asked for: not before a cancelled one has ended."""
        if self._thread is None:
            is_free = self._cancelled is None or not self._cancelled.is_alive()
            if is_free and self._is_asked and self._calibrator is not None:
                self._is_asked = False
                self._thread = _Calibrating(self._calibrator, self._path)
            return
        if self._stage.node.action is not None:
            self._stage.node.action.report(self._thread.step, self._thread.share)
        if not self._thread.is_alive():
            done, self._thread = self._thread, None
            self._failure = "" if done.body is not None else done.text
            if done.body is None:
                self._stage.log.error("\n".join(filter(None, [done.text, done.defect])))
            else:
                self._stage.log.info(done.text)
                self._on_body(done.body)
            self._answer(done.body is not None, done.text)


class _Stopped(Exception):
    """Nobody needs the result any more."""


class _Calibrating(threading.Thread):
    """Makes the body of what was collected, and writes it and its report; starts at once.

    Args:
        calibrator: may collect further in the meantime.
        path: of the body file; the report goes beside it. Both are replaced only by a body that is complete.

    Attributes:
        step, share: what it is doing and how much of that is done, 0 to 1.
        body: once the thread has ended, the body; None after an error.
        text: once the thread has ended, a summary or the error; empty if it has given up.
        defect: traceback of an error that is ours and not the user's; empty otherwise.
    """

    def __init__(self, calibrator: BodyCalibrator, path: Path) -> None:
        super().__init__(name="calibration", daemon=True)
        self._calibrator, self._path = calibrator, path
        self._turn = threading.Lock()
        self._stopped = self._is_writing = False
        self.step, self.share = "start", 0.0
        self.body: BodyModel | None = None
        self.text = self.defect = ""
        self.start()

    def give_up(self) -> bool:
        """End at the next step and write nothing; False if it is too late, for it is writing already."""
        with self._turn:
            self._stopped = not self._is_writing
            return self._stopped

    def run(self) -> None:
        """Do the work; for ``start``."""
        try:
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
            self.defect = traceback.format_exc()

    def _on_progress(self, step: str, share: float, is_writing: bool = False) -> None:
        with self._turn:
            if self._stopped:
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
