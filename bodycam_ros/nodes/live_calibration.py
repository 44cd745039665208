"""The solver's calibration: it collects a range of motion, and makes a body of it when a service is called."""

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from std_srvs.srv import Trigger

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.calibration.body_calibrator import BodyCalibrator
from bodycam_ros.calibration.rig import Rig
from bodycam_ros.camera import CameraModel
from bodycam_ros.errors import BodyError
from bodycam_ros.messages.factory import Message
from bodycam_ros.messages.status import Health, HealthLevel
from bodycam_ros.nodes.calibration_thread import CalibrationThread
from bodycam_ros.nodes.later_service import LaterService
from bodycam_ros.nodes.node_parameters import SolverParameters
from bodycam_ros.nodes.stage_node import StageNode
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.registration.map_frame import check_upright
from bodycam_ros.registration.reference_map import ReferenceMap

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
        settings, facing_deg = self._node.settings, self._node.parameters.facing
        self._calibrator = BodyCalibrator(
            self._rig,
            cameras,
            self._node.calibration_settings,
            settings.pose_fit,
            settings.evidence,
            None if math.isnan(facing_deg) else math.radians(facing_deg),
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
