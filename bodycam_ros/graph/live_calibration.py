"""Calibration in the solver: collects a range of motion, and makes a body of it on request (A 4.2)."""

import logging
import math
from collections.abc import Mapping
from concurrent.futures import CancelledError, Future, ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from pathlib import Path
from threading import Event

from bodycam_ros.body.body_file import read_body, write_body
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.equipment import Equipment
from bodycam_ros.calibration.body_calibrator import BodyCalibrator, CalibratedBody
from bodycam_ros.calibration.rig import Rig
from bodycam_ros.camera import CameraModel
from bodycam_ros.errors import BodycamError, BodyError
from bodycam_ros.evaluate.body_report import body_report, html_report
from bodycam_ros.files.whole_file import write_whole
from bodycam_ros.graph.node_parameters import SolverParameters
from bodycam_ros.messages.diagnostics import Status, StatusLevel
from bodycam_ros.pipeline.settings import PipelineSettings
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.registration.reference_map import load_map

logger = logging.getLogger(__name__)


class LiveCalibration:
    """Collects registrations, and makes the body of them while the node goes on.

    Collecting continues after success and after failure: move the joints that lack motion, and ask again.

    Args:
        parameters: of the solver.
        equipment: as given; None without.

    Attributes:
        path: output body YAML.
        cameras: the rig's.

    Raises:
        BodyError: the rig cannot be read, the body exists and must not be replaced, its folder is missing, or a
            parameter cannot be combined with a range of motion.
        MapError: the map has no scale or no vertical.
    """

    def __init__(self, parameters: SolverParameters, equipment: Equipment | None) -> None:
        self.path = path = Path(parameters.body)
        self._rig = Rig.from_yaml(parameters.rig)
        if equipment is not None and equipment.mounts:
            raise BodyError(
                f"equipment {equipment.name}: carries {', '.join(equipment.mounts)}, which a range of motion does not "
                "need; make the body first, then start again with 'equipment' and without 'rig'"
            )
        if parameters.cameras:
            raise BodyError(f"{path}: a calibration needs all cameras of the rig, so leave out the parameter 'cameras'")
        if path.exists() and not parameters.overwrite_body:
            raise BodyError(
                f"{path}: exists already, and with a 'rig' it would be replaced; to allow that give "
                "-p overwrite_body:=true, to use it as it is leave out 'rig'"
            )
        if not path.parent.is_dir():
            raise BodyError(f"{path}: its folder does not exist; make it first")
        if not parameters.map:
            raise BodyError("the parameter 'map' is missing: a calibration needs its scale and its vertical")
        load_map(Path(parameters.map), upright=True)
        self.cameras = tuple(self._rig.cameras)
        self._facing = None if math.isnan(parameters.facing) else math.radians(parameters.facing)
        self._calibrator: BodyCalibrator | None = None
        self._run: Future[CalibratedBody] | None = None
        self._worker, self._dropped = ThreadPoolExecutor(1, "calibration"), Event()
        self._step, self._share = "start", 0.0
        self._collected = 0
        self._failure = ""

    def start(self, cameras: Mapping[str, CameraModel], settings: PipelineSettings) -> None:
        """Start to collect; raises RangeOfMotionError if the model of one of the rig's cameras is missing."""
        self._collected = 0
        self._calibrator = BodyCalibrator(
            self._rig,
            {**cameras},  # as they are now: what is collected was registered by these
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

    def restart(self) -> str:
        """Drop the collected registrations and a calibration; return what to do."""
        self._drop()
        if self._calibrator is not None:
            self._calibrator.forget()
        self._collected, self._failure = 0, ""
        return "collecting again; start with the N-pose, standing still, then go through the range of motion"

    def make_body(self) -> str:
        """Start to make a body of the registrations collected so far; return where the result will be.

        Raises:
            BodyError: the camera_info of a camera is missing.
        """
        if self._calibrator is None:
            raise BodyError(f"there is no camera_info yet of all of the rig's cameras {', '.join(self.cameras)}")
        if self._run is None:
            # One that was dropped ends first.
            self._dropped = Event()
            progress = partial(self._set_progress, self._dropped)
            self._run = self._worker.submit(self._calibrator.solve, self.path.stem, progress)
        return f"making {self.path}; /diagnostics has the progress and the result"

    def poll(self) -> BodyModel | None:
        """The new body, once, after it and its report were written; call it regularly."""
        if self._run is None or not self._run.done():
            return None
        done, self._run = self._run, None
        try:
            calibrated = done.result()
            body = replace(calibrated.body, report=body_report(calibrated.diagnosis))
            write_whole(self.path.with_suffix(".html"), html_report(body, calibrated.diagnosis))
            write_body(body, self.path)
            logger.warning("%s", _summary(self.path, calibrated))
            self._failure = ""
            # Read from the file, which rounds, so that a replay with the file gives the same result.
            return read_body(self.path)
        except BodycamError as error:
            self._failure = str(error)
            logger.error("%s", error)
        except Exception as error:
            self._failure = (
                f"the calibration failed ({type(error).__name__}: {error}); the node's log has the traceback"
            )
            logger.exception("calibration")
        return None

    def stop(self) -> BodyModel | None:
        """The new body if it is there; a calibration that goes on is dropped."""
        body = self.poll()
        self._drop()
        return body

    def report(self) -> Status:
        """Progress."""
        values: dict[str, object] = {"registrations collected": self._collected}
        if self._run is not None:
            values |= {"step": self._step, "done [%]": round(100 * self._share)}
            return Status("calibration", StatusLevel.OK, "calibrating", values)
        level = StatusLevel.WARN if self._failure else StatusLevel.OK
        return Status("calibration", level, self._failure or "collecting", values)

    def _drop(self) -> None:
        """A calibration that goes on ends at its next step; nothing is written of it."""
        self._dropped.set()
        self._run = None

    def _set_progress(self, dropped: Event, step: str, share: float) -> None:
        if dropped.is_set():
            raise CancelledError
        self._step, self._share = step, share


def _summary(path: Path, calibrated: CalibratedBody) -> str:
    diagnosis = calibrated.diagnosis
    text = f"{path} written: {len(diagnosis.joints)} joints and {len(diagnosis.cameras)} cameras"
    if diagnosis.warnings:
        text += f"; check: {'; '.join(diagnosis.warnings)}"
    return text
