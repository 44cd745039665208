"""Node ``skeleton_solver``: the registrations of all cameras in, the articulated body out (A 4.3).

With a rig instead of a body it first makes the body, from a range of motion (A 4.2).
"""

import time
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from std_srvs.srv import Trigger

from bodycam_ros.body.body_file import read_body
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.calibration.rig import Rig
from bodycam_ros.errors import BodyError
from bodycam_ros.messages.factory import Message
from bodycam_ros.messages.registration_health import timing_health
from bodycam_ros.messages.status import Health, HealthLevel, few
from bodycam_ros.messages.tracks import landmark_matches
from bodycam_ros.messages.verdict_health import verdict_health
from bodycam_ros.nodes.body_topics import BodyTopics
from bodycam_ros.nodes.camera_topics import CameraModels
from bodycam_ros.nodes.flow_of_frames import MissedFrames
from bodycam_ros.nodes.graph import cameras_used
from bodycam_ros.nodes.live_calibration import LiveCalibration
from bodycam_ros.nodes.parameters import SOLVER_GROUPS, SolverParameters
from bodycam_ros.nodes.qos import STAGE_DEPTH, reliable
from bodycam_ros.nodes.run import run
from bodycam_ros.nodes.stage_node import StageNode
from bodycam_ros.pipeline import SkeletonPipeline
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.solving.body_output import BodyOutput
from bodycam_ros.verdict.live_verdict import LiveVerdict

_LOOK_S = 0.5
_ARRIVALS = 1000
_JUMP_NS = 1_000_000_000
_PATIENCE_S = 2.0
"""Registrations that come for so long without an instant solved are an error."""


@dataclass
class _Tally:
    """What happened since the last report."""

    heard: int = 0
    solved: int = 0
    predicted: int = 0
    cameras_used: int = 0
    latency_s: float = 0.0


class SkeletonSolver(StageNode[SolverParameters]):
    """Solves the body once every camera's camera_info is here, or ``info_wait`` after the first; later ones join.

    With a rig it waits for the camera_info of all of the rig's cameras, and has no body to solve until one is made.
    Where most cameras go back in time, the body begins anew there.
    """

    def __init__(self) -> None:
        super().__init__("skeleton_solver", SolverParameters, SOLVER_GROUPS)
        self._topics = BodyTopics(self)
        self._body: BodyModel | None = None
        self._calibration: LiveCalibration | None = None
        path = Path(self.required("body"))
        carried = self._prepare_calibration(path) if self.parameters.rig else self._read_body(path)
        self._pipeline: SkeletonPipeline | None = None
        self._verdict: LiveVerdict | None = None
        self._started = False
        self._waiting: list[LandmarkMatches] = []
        self._most_waiting = STAGE_DEPTH * len(carried)
        self._missed = MissedFrames()
        self._tally = _Tally()
        self._late_reported = 0
        self._first_info_s: float | None = None
        self._heard_s = self._begun_s = self._solved_s = 0.0
        self._arrivals: deque[tuple[int, float]] = deque(maxlen=_ARRIVALS)
        self._flushed = True
        self._cameras = CameraModels(self, carried, self._on_camera)
        for camera in carried:
            on_landmarks = partial(self._on_landmarks, camera)
            self.subscription(
                "bodycam_msgs/msg/LandmarkMatches", f"{camera}/landmarks", on_landmarks, reliable(STAGE_DEPTH)
            )
        self.create_service(Trigger, "~/flush", self._on_flush)
        self.every(_LOOK_S, self._look)

    def finish(self) -> None:
        """Publish what waits for later instants before the node goes."""
        if self._calibration is not None:
            self._calibration.stop()
        self._flush()
        self._topics.wait_until_heard()

    def _read_body(self, path: Path) -> tuple[str, ...]:
        """Learn the body that is there; its cameras."""
        self._body = read_body(path)
        used = cameras_used(self.parameters.cameras, tuple(self._body.mounts), f"{path}: the body")
        self._topics.describe(self._body)
        return used

    def _prepare_calibration(self, path: Path) -> tuple[str, ...]:
        """Be ready to make the body; the rig's cameras."""
        rig = Rig.from_yaml(self.parameters.rig)
        if self.parameters.cameras:
            raise BodyError(f"{path}: a calibration needs all cameras of the rig, so leave out the parameter 'cameras'")
        self._calibration = LiveCalibration(self, rig, path, lambda: self._cameras.missing, self._solve_new)
        return tuple(rig.cameras)

    def _on_camera(self, camera: str) -> None:
        self._first_info_s = self._first_info_s or time.monotonic()
        if self._started:
            self._join(camera)
        elif not self._cameras.missing:
            self._start()

    def _join(self, camera: str) -> None:
        """A camera's model has come late, or has become another."""
        if self._calibration is not None and not self._calibration.is_running:
            self._calibration.begin(self._cameras.models)
        model = self._cameras.models.get(camera)
        if model is None:
            return
        if self._pipeline is not None:
            self._publish(self._pipeline.join(camera, model))
            self._judge_anew()
        else:
            self._solve_with_those_known()

    def _start(self) -> None:
        """Enough cameras are known: from now on they are collected, or the body is solved, or both."""
        self._started = True
        if self._calibration is not None:
            self._calibration.begin(self._cameras.models)
        for camera in self._cameras.missing:
            self.get_logger().warning(f"there is no {camera}/camera_info yet; the camera joins when it comes")
        self._solve_with_those_known()
        for matches in self._waiting:
            self._take(matches)
        self._waiting.clear()

    def _solve_with_those_known(self) -> None:
        if self._body is not None and self._cameras.models:
            self._pipeline = SkeletonPipeline(self._body, self._cameras.models, self.settings, live=True)
            self._late_reported = 0
            self._judge_anew()

    def _judge_anew(self) -> None:
        """Other cameras or another body: what was seen before says nothing of them."""
        if self._body is not None:
            inlier_px = self.settings.pose_fit.inlier_px
            self._verdict = LiveVerdict(self._body, self._cameras.models, self.settings.verdict, inlier_px)

    def _solve_new(self, body: BodyModel) -> None:
        """There is a new body: the registrations from now on are its own."""
        self._flush()
        self._body = body
        self._solve_with_those_known()
        self._topics.describe(body)

    def _take(self, matches: LandmarkMatches) -> None:
        if self._calibration is not None:
            self._calibration.add(matches)
        if self._verdict is not None:
            self._verdict.add_registration(matches)
        if self._pipeline is not None:
            self._publish(self._pipeline.add(matches))

    def _on_landmarks(self, camera: str, message: Message) -> None:
        try:
            matches = landmark_matches(message, camera)
        except ValueError as error:
            self.skipped.add("registrations skipped", f"{camera}/landmarks: malformed message ({error})")
            return
        if self._missed.add(camera, matches.stamp_ns, matches.previous_stamp_ns):
            self.skipped.add(
                "registrations lost", f"camera {camera}: the registration before {matches.stamp_ns} ns is lost"
            )
        self._note_arrival(matches.stamp_ns)
        if self._started:
            self._take(matches)
        elif len(self._waiting) < self._most_waiting:
            self._waiting.append(matches)
        else:
            self.skipped.add("registrations skipped", "registrations, but no camera_info of the cameras")

    def _note_arrival(self, stamp_ns: int) -> None:
        self._tally.heard += 1
        now_s = time.monotonic()
        if now_s - self._heard_s > _PATIENCE_S:
            self._begun_s = now_s
        self._heard_s = now_s
        self._flushed = False
        if self._arrivals and stamp_ns < self._arrivals[-1][0] - _JUMP_NS:
            self._arrivals.clear()
        if not self._arrivals or stamp_ns > self._arrivals[-1][0]:
            self._arrivals.append((stamp_ns, self._heard_s))

    def _look(self) -> None:
        now_s = time.monotonic()
        waited_s = now_s - self._first_info_s if self._first_info_s else 0.0
        if not self._started and self._calibration is None and waited_s > self.parameters.info_wait:
            self._start()
        if now_s - self._heard_s > self.parameters.idle_flush:
            self._flush()
        elif self._pipeline is not None:
            self._publish(self._pipeline.look())

    def _on_flush(self, request: Message, response: Message) -> Message:
        response.success, response.message = True, f"{self._flush()} instants published"
        return response

    def _flush(self) -> int:
        """Publish the instants that wait for later ones; how many there were."""
        if self._flushed or self._pipeline is None:
            return 0
        self._flushed = True
        outputs = self._pipeline.flush()
        self._publish(outputs)
        return len(outputs)

    def _publish(self, outputs: Iterable[BodyOutput]) -> None:
        for output in outputs:
            if self._body is not None:
                self._topics.publish(output, self._body)
            if self._verdict is not None:
                self._verdict.add_state(output.state.stamp_ns, output.state.world_T_segment)
            self._solved_s = time.monotonic()
            self._tally.solved += 1
            self._tally.predicted += output.state.predicted
            self._tally.cameras_used += output.state.cameras_used
            arrived_s = self._solved_s
            while self._arrivals and self._arrivals[0][0] <= output.state.stamp_ns:
                arrived_s = self._arrivals.popleft()[1]
            self._tally.latency_s += self._solved_s - arrived_s

    def health(self) -> list[Health]:
        """How the body fared in the last second, and how its cameras go together."""
        tally, self._tally = self._tally, _Tally()
        assembler = self._pipeline.assembler if self._pipeline else None
        values: dict[str, object] = {
            "registrations per second": tally.heard,
            "instants per second": tally.solved,
            "instants predicted": tally.predicted,
            "latency [ms]": round(1e3 * tally.latency_s / tally.solved) if tally.solved else "none",
            "cameras used per instant": round(tally.cameras_used / max(1, tally.solved), 1),
            "cameras known": len(self._cameras.models),
            "cameras missing": ", ".join([*self._cameras.missing, *sorted(self._cameras.refused)]) or "none",
            "camera_info changed": self._cameras.changes,
            "late registrations": assembler.late if assembler else 0,
            "times begun anew": assembler.restarts if assembler else 0,
            **self.skipped.counts,
            "last error": self.skipped.latest or "none",
        }
        level, text = self._judge(tally)
        health = [Health("body", level, text, values), *self._camera_healths()]
        if self._verdict is not None:
            health.append(verdict_health(self._verdict.verdict()))
        return health if self._calibration is None else [*health, self._calibration.health()]

    def _judge(self, tally: _Tally) -> tuple[HealthLevel, str]:
        lost = self.skipped.lately()
        now_late = self._pipeline.assembler.late if self._pipeline else 0
        late, self._late_reported = now_late - self._late_reported, now_late
        quiet_s = time.monotonic() - self._heard_s
        lacking = few([*self._cameras.missing, *sorted(self._cameras.refused)])
        if quiet_s > _PATIENCE_S:
            return HealthLevel.ERROR, "no registration comes" + (
                f", and no camera_info of {lacking}" if lacking else ""
            )
        if self._pipeline is None and self._body is None:
            return HealthLevel.OK, "no body yet"
        if self._pipeline is None:
            return HealthLevel.ERROR, f"registrations, but no camera_info of {lacking}"
        if tally.solved == 0 and self._heard_s - max(self._solved_s, self._begun_s) > _PATIENCE_S:
            return HealthLevel.ERROR, "registrations come, but no camera is registered in the map"
        if tally.solved and tally.predicted == tally.solved:
            return HealthLevel.ERROR, "no camera is registered; the body is a guess"
        if lacking:
            return HealthLevel.WARN, f"solving without {lacking}: no usable camera_info"
        if tally.predicted or late > 0 or lost:
            return HealthLevel.WARN, "solving, with losses"
        return HealthLevel.OK, "solving"

    def _camera_healths(self) -> list[Health]:
        """How each camera goes with the others."""
        if self._pipeline is None:
            return []
        assembler, silent = self._pipeline.assembler, self._pipeline.assembler.silent
        return [
            timing_health(
                camera, timing, self.settings.assembler.sync_tolerance, assembler.late_of[camera], camera in silent
            )
            for camera, timing in assembler.synchrony.timings().items()
        ]


def main() -> int:
    """Run the node until it is stopped; its exit code."""
    return run(SkeletonSolver, "skeleton_solver")
