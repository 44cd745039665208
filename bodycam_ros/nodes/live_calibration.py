"""The solver's calibration: it collects a range of motion, and makes a body of it for the asking."""

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Self

from std_srvs.srv import Trigger

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.calibration.body_calibrator import BodyCalibrator
from bodycam_ros.calibration.rig import Rig
from bodycam_ros.camera import CameraModel
from bodycam_ros.equipment.equipment import Equipment
from bodycam_ros.errors import BodyError
from bodycam_ros.messages.factory import Message
from bodycam_ros.messages.status import Health, HealthLevel
from bodycam_ros.nodes.calibration_thread import CalibrationThread
from bodycam_ros.nodes.later_action import LaterAction
from bodycam_ros.nodes.later_service import LaterService
from bodycam_ros.nodes.loaded_map import load_map
from bodycam_ros.nodes.parameters import SolverParameters
from bodycam_ros.nodes.stage_node import StageNode
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.registration.reference_map import check_upright

_ACTION = "bodycam_msgs/action/Calibrate"
_LOOK_S = 0.2
_STOP_S = 5.0


def calibrate_action(
    node: StageNode[SolverParameters], calibration: Callable[[], "LiveCalibration | None"]
) -> LaterAction:
    """The action ``~/calibrate``, of a calibration that is there once the node is configured."""
    return LaterAction(node, _ACTION, "~/calibrate", calibration)


class LiveCalibration:
    """Collects from the start, or from the latest ``~/start_calibration``; ``~/calibrate`` makes the body.

    That is a service, and an action, which says how far it is and can be called off. Neither success nor failure ends
    the collecting: who has not moved a joint enough moves it and calls again.

    Args:
        node: the solver.
        rig: which camera is on which segment.
        path: body YAML to write.
        action: in which it may be asked for as well; None where there is none.
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
        action: LaterAction | None,
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
        check_upright(load_map(map_path), map_path)
        self._node = node
        self._rig = rig
        self._path = path
        self._missing_cameras = missing_cameras
        self._on_body = on_body
        self._calibrator: BodyCalibrator | None = None
        self._thread: CalibrationThread | None = None
        self._given_up: CalibrationThread | None = None
        self._collected = 0
        self._failure = ""
        self._action = action
        if action is not None and action.lacking:
            node.get_logger().warning(f"{action.lacking}; the service of that name does the same")
        self._calibrate = LaterService(node, "~/calibrate", self.make)
        node.create_service(Trigger, "~/start_calibration", self._on_start)
        node.every(_LOOK_S, self._look, even_inactive=True)

    @classmethod
    def of(
        cls,
        node: StageNode[SolverParameters],
        equipment: Equipment | None,
        path: Path,
        action: LaterAction | None,
        missing_cameras: Callable[[], Sequence[str]],
        on_body: Callable[[BodyModel], None],
    ) -> Self:
        """That of the rig which the solver's parameters name.

        Raises:
            BodyError: the rig cannot be read, or what else is asked for does not go with a range of motion; as above.
            MapError, SettingsError: as above.
        """
        rig = Rig.from_yaml(node.parameters.rig)
        if equipment is not None and equipment.mounts:
            raise BodyError(
                f"equipment {equipment.name}: carries {', '.join(equipment.mounts)}, which a range of motion does not "
                "need; make the body first, then start again with 'equipment' and without 'rig'"
            )
        if node.parameters.cameras:
            raise BodyError(f"{path}: a calibration needs all cameras of the rig, so leave out the parameter 'cameras'")
        return cls(node, rig, path, action, missing_cameras, on_body)

    @property
    def cameras(self) -> tuple[str, ...]:
        """The rig's."""
        return tuple(self._rig.cameras)

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

    def cancel(self) -> bool:
        """Call off what is being worked at, which costs nothing that was there; False if it is too late for that."""
        if not self._give_up():
            return False
        # Not here: it is called off only once this has been said.
        self._node.soon(lambda: self._answer(False, "called off; nothing was written"), even_inactive=True)
        return True

    def stop(self) -> None:
        """Give up what is being worked at; a body that is being written already is waited for."""
        if not self._give_up() and self._thread is not None:
            self._thread.join(_STOP_S)
            self._look()
        self._answer(False, "the node was stopped")

    def _give_up(self) -> bool:
        if self._thread is not None and not self._thread.give_up():
            return False
        self._given_up, self._thread = self._thread or self._given_up, None
        return True

    def _answer(self, success: bool, text: str) -> None:
        self._calibrate.answer(success, text)
        if self._action is not None:
            self._action.answer(success, text)

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

    def make(self, goal: Message | None = None) -> None:
        """Make a body of what was collected by now, for who asks, whatever with."""
        if not self._node.is_active:
            self._answer(False, "the node is inactive; activate it first")
        elif self._calibrator is None:
            missing = ", ".join(self._missing_cameras())
            self._answer(False, f"there is no camera_info yet of the rig's cameras {missing}")
        else:
            self._look()

    @property
    def _is_asked(self) -> bool:
        return self._calibrate.is_asked or (self._action is not None and self._action.is_asked)

    def _look(self) -> None:
        """Take what is done, and begin what is asked for: not before who has given up has ended."""
        if self._thread is None:
            is_free = self._given_up is None or not self._given_up.is_alive()
            if is_free and self._is_asked and self._calibrator is not None:
                self._thread = CalibrationThread(self._calibrator, self._path)
            return
        if self._action is not None:
            self._action.tell(self._thread.step, self._thread.share)
        if not self._thread.is_alive():
            done, self._thread = self._thread, None
            self._take(done)

    def _take(self, done: CalibrationThread) -> None:
        if done.body is None:
            self._failure = done.text
            self._node.get_logger().error("\n".join(filter(None, [done.text, done.defect])))
        else:
            self._failure = ""
            self._node.get_logger().info(done.text)
            self._on_body(done.body)
        self._answer(done.body is not None, done.text)
