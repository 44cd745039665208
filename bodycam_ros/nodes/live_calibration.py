"""The solver's calibration: it collects a range of motion, and makes a body of it when a service is called."""

import math
import threading
import traceback
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from std_srvs.srv import Trigger

from bodycam_ros.body.body_file import read_body, write_body
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.calibration.body_calibrator import BodyCalibrator, CalibratedBody
from bodycam_ros.calibration.report.html_report import write_html_report
from bodycam_ros.calibration.report.report_tables import body_report
from bodycam_ros.calibration.rig import Rig
from bodycam_ros.camera import CameraModel
from bodycam_ros.errors import BodycamError, BodyError
from bodycam_ros.messages.factory import Message
from bodycam_ros.messages.status import Health, HealthLevel
from bodycam_ros.nodes.later_service import LaterService
from bodycam_ros.nodes.parameters import SolverParameters
from bodycam_ros.nodes.stage_node import StageNode
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.registration.reference_map import ReferenceMap, check_upright

_LOOK_S = 0.2
_STOP_S = 5.0


class LiveCalibration:
    """Collects from the start, or from the latest ``~/start_calibration``; ``~/calibrate`` makes the body.

    Neither success nor failure ends the collecting: who has not moved a joint enough moves it and calls again.

    Args:
        node: the solver.
        rig: which camera is on which segment.
        path: body YAML to write.
        missing_cameras: says whose camera_info is not here yet.
        on_body: called with each new body.

    Raises:
        BodyError: the body is there already and is not to be overwritten, or cannot be written there.
        MapError: the map has no scale or no vertical.
        SettingsError: nobody says which map it is.
    """

    def __init__(
        self,
        node: StageNode[SolverParameters],
        rig: Rig,
        path: Path,
        missing_cameras: Callable[[], Sequence[str]],
        on_body: Callable[[BodyModel], None],
    ) -> None:
        if path.exists() and not node.parameters.overwrite_body:
            raise BodyError(
                f"{path}: is there already, and with a 'rig' it would be replaced; to allow that give "
                "-p overwrite_body:=true, to use it as it is leave out 'rig'"
            )
        if not path.parent.is_dir():
            raise BodyError(f"{path}: its folder is not there; make it first")
        map_path = Path(node.required("map"))
        check_upright(ReferenceMap.load(map_path), map_path)
        self._node = node
        self._rig = rig
        self._path = path
        self._missing_cameras = missing_cameras
        self._on_body = on_body
        self._calibrator: BodyCalibrator | None = None
        self._thread: CalibrationThread | None = None
        self._collected = 0
        self._failure = ""
        self._calibrate = LaterService(node, "~/calibrate", self._on_calibrate)
        node.create_service(Trigger, "~/start_calibration", self._on_start)
        node.every(_LOOK_S, self._look)

    @property
    def is_running(self) -> bool:
        """Whether a calibration is being worked at."""
        return self._thread is not None

    def begin(self, cameras: Mapping[str, CameraModel]) -> None:
        """The cameras are known; raises RangeOfMotionError if one of the rig's is not among them."""
        self._collected = 0
        settings, facing_deg = self._node.settings, self._node.parameters.facing
        self._calibrator = BodyCalibrator(
            self._rig,
            cameras,
            self._node.calibration_settings,
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

    def stop(self) -> None:
        """Give up what is being worked at."""
        if self._thread is not None:
            self._thread.stop(_STOP_S)
            if self._thread.body is not None:
                # Who is writing a body already is not interrupted: it is there.
                self._calibrate.answer(True, self._thread.text)
        self._calibrate.answer(False, "the node was stopped")

    def health(self) -> Health:
        """How far it is."""
        values: dict[str, object] = {"registrations collected": self._collected}
        if self._thread is not None:
            values |= {"step": self._thread.step, "done [%]": round(100 * self._thread.share)}
            return Health("calibration", HealthLevel.OK, "calibrating", values)
        if self._failure:
            return Health("calibration", HealthLevel.WARN, self._failure, values)
        return Health("calibration", HealthLevel.OK, "collecting", values)

    def _on_start(self, request: Message, response: Message) -> Message:
        if self._thread is not None:
            response.success, response.message = False, "a calibration is running; call again when it has answered"
            return response
        if self._calibrator is not None:
            self._calibrator.forget()
        self._collected, self._failure = 0, ""
        response.success = True
        response.message = "collecting anew; begin with the N-pose, standing still, then go through the range of motion"
        return response

    def _on_calibrate(self) -> None:
        if self._calibrator is None:
            missing = ", ".join(self._missing_cameras())
            self._calibrate.answer(False, f"there is no camera_info yet of the rig's cameras {missing}")
        else:
            self._thread = CalibrationThread(self._calibrator, self._path)

    def _look(self) -> None:
        if self._thread is None or self._thread.is_alive():
            return
        done, self._thread = self._thread, None
        if done.body is None:
            self._failure = done.text
            self._node.get_logger().error("\n".join(filter(None, [done.text, done.defect])))
        else:
            self._failure = ""
            self._node.get_logger().info(done.text)
            self._on_body(done.body)
        self._calibrate.answer(done.body is not None, done.text)


class _Stopped(Exception):
    """Nobody needs the result any more."""


class CalibrationThread(threading.Thread):
    """Estimates the body from what was collected until now, and writes it and its report; starts at once.

    Args:
        calibrator: may collect further in the meantime.
        path: of the body file; the report goes beside it. Both are replaced only by a body that is complete.

    Attributes:
        step, share: what it is doing and how much of that is done, 0 to 1.
        body: once the thread has ended, the body; None after an error.
        text: once the thread has ended, what to tell the user: a summary, or the error.
        defect: traceback of an error that is ours and not the user's; empty otherwise.
    """

    def __init__(self, calibrator: BodyCalibrator, path: Path) -> None:
        super().__init__(name="calibration", daemon=True)
        self._calibrator = calibrator
        self._path = path
        self._stopped = False
        self.step, self.share = "start", 0.0
        self.body: BodyModel | None = None
        self.text = "stopped"
        self.defect = ""
        self.start()

    def stop(self, patience_s: float) -> None:
        """Give up at the next step of the work, and wait for that so long."""
        self._stopped = True
        self.join(patience_s)

    def run(self) -> None:
        """Do the work; for ``start``."""
        try:
            calibrated = self._calibrator.solve(self._path.stem, self._on_progress)
            self._on_progress("report", 0.0)
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
            self.text = f"the calibration broke down ({type(error).__name__}: {error}); the node's log says where"
            self.defect = traceback.format_exc()

    def _on_progress(self, step: str, share: float) -> None:
        if self._stopped:
            raise _Stopped
        self.step, self.share = step, share


def _summary(path: Path, calibrated: CalibratedBody) -> str:
    diagnosis = calibrated.diagnosis
    text = f"{path} written: {len(diagnosis.joints)} joints and {len(diagnosis.cameras)} cameras"
    if diagnosis.refinement is not None:
        text += f", reprojection error {diagnosis.refinement.after_px:.2f} px"
    if diagnosis.warnings:
        text += f"; look at: {'; '.join(diagnosis.warnings)}"
    return text
