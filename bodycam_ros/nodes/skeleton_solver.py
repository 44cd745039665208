"""Node ``skeleton_solver``: the registrations of all cameras in, the articulated body out (A 4.3)."""

import time
from collections.abc import Iterable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from rclpy.duration import Duration
from std_srvs.srv import Trigger

from bodycam_ros.body.body_file import read_body
from bodycam_ros.body.urdf import urdf_text
from bodycam_ros.errors import BodyError
from bodycam_ros.mapping.landmark_matches import LandmarkMatches
from bodycam_ros.messages.body_output import output_messages
from bodycam_ros.messages.factory import Message
from bodycam_ros.messages.status import Health, HealthLevel, text_message
from bodycam_ros.messages.tracks import landmark_matches
from bodycam_ros.nodes.camera_models import CameraModels
from bodycam_ros.nodes.message_classes import TRANSFORMS, is_installed
from bodycam_ros.nodes.missed_frames import MissedFrames
from bodycam_ros.nodes.node_parameters import SolverParameters
from bodycam_ros.nodes.quality import OUTPUT_DEPTH, STAGE_DEPTH, latched, reliable
from bodycam_ros.nodes.run import run
from bodycam_ros.nodes.stage_node import StageNode
from bodycam_ros.pipeline import BodyOutput, SkeletonPipeline

GROUPS = ("assembler", "smoother", "motion", "evidence", "pose_fit")

OUTPUTS = {
    "/joint_states": "sensor_msgs/msg/JointState",
    "/joint_rotations": "sensor_msgs/msg/MultiDOFJointState",
    "/odometry": "nav_msgs/msg/Odometry",
    "/tf": TRANSFORMS,
    "/skeleton": "visualization_msgs/msg/MarkerArray",
}
"""Topic -> type of what ``output_messages`` makes."""

_LOOK_S = 0.5
_LAST_WORDS = Duration(nanoseconds=500_000_000)


@dataclass
class _Tally:
    solved: int = 0
    predicted: int = 0
    cameras_used: int = 0


class SkeletonSolver(StageNode[SolverParameters]):
    """Solves the body once every camera's camera_info is here, or ``info_wait`` after the first."""

    def __init__(self) -> None:
        super().__init__("skeleton_solver", SolverParameters, GROUPS)
        self.body = read_body(Path(self.required("body")))
        if not self.body.mounts:
            raise BodyError(f"{self.parameters.body}: the body carries no camera, so there is nothing to solve it from")
        self._pipeline: SkeletonPipeline | None = None
        self._waiting: list[LandmarkMatches] = []
        self._most_waiting = STAGE_DEPTH * len(self.body.mounts)
        self._missed = MissedFrames()
        self._tally = _Tally()
        self._first_info_s: float | None = None
        self._heard_s = 0.0
        self._flushed = True
        self._description = self.publisher("std_msgs/msg/String", "robot_description", latched())
        self._description.publish(text_message(self.make, urdf_text(self.body)))
        self._outputs = {
            # Transforms are everybody's; the rest moves with the node's namespace.
            topic: self.publisher(type_name, topic if topic == "/tf" else topic[1:], reliable(OUTPUT_DEPTH))
            for topic, type_name in OUTPUTS.items()
            if is_installed(type_name)
        }
        self._cameras = CameraModels(self, self.body.mounts, self._on_camera)
        for camera in self.body.mounts:
            on_landmarks = partial(self._on_landmarks, camera)
            self.subscription(
                "bodycam_msgs/msg/LandmarkMatches", f"{camera}/landmarks", on_landmarks, reliable(STAGE_DEPTH)
            )
        self.create_service(Trigger, "~/flush", self._on_flush)
        self.every(_LOOK_S, self._look)

    def finish(self) -> None:
        """Publish what waits for later instants before the node goes."""
        self._flush()
        for publisher in self._outputs.values():
            publisher.wait_for_all_acked(_LAST_WORDS)

    def _on_camera(self, camera: str) -> None:
        if self._pipeline is not None:
            self.get_logger().warning(f"camera {camera}: its camera_info came too late; restart this node to use it")
            return
        self._first_info_s = self._first_info_s or time.monotonic()
        if not self._cameras.missing:
            self._start()

    def _start(self) -> None:
        """The cameras are known: from now on the body is solved."""
        for camera in self._cameras.missing:
            self.get_logger().warning(
                f"camera {camera}: is on body {self.body.name}, but there is no {camera}/camera_info"
            )
        self._pipeline = SkeletonPipeline(self.body, self._cameras.models, self.settings)
        for matches in self._waiting:
            self._publish(self._pipeline.add(matches))
        self._waiting.clear()

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
        self._heard_s = time.monotonic()
        self._flushed = False
        if self._pipeline is not None:
            self._publish(self._pipeline.add(matches))
        elif len(self._waiting) < self._most_waiting:
            self._waiting.append(matches)
        else:
            self.skipped.add("registrations skipped", "registrations, but no camera_info of any camera of the body")

    def _look(self) -> None:
        now_s = time.monotonic()
        if self._pipeline is None and self._first_info_s and now_s - self._first_info_s > self.parameters.info_wait:
            self._start()
        if now_s - self._heard_s > self.parameters.idle_flush:
            self._flush()

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
        if outputs:
            self.report(outputs[-1].state.stamp_ns, self._health())
        return len(outputs)

    def _publish(self, outputs: Iterable[BodyOutput]) -> None:
        for output in outputs:
            messages = output_messages(self.make, output, self.body)
            for topic, publisher in self._outputs.items():
                publisher.publish(messages[topic])
            self._tally.solved += 1
            self._tally.predicted += output.state.predicted
            self._tally.cameras_used += output.state.cameras_used
            self.report_when_due(output.state.stamp_ns, self._health)

    def _health(self) -> list[Health]:
        tally, self._tally = self._tally, _Tally()
        late = self._pipeline.assembler.late if self._pipeline else 0
        values: dict[str, object] = {
            "instants solved": tally.solved,
            "instants predicted": tally.predicted,
            "cameras used per instant": round(tally.cameras_used / max(1, tally.solved), 1),
            "cameras known": len(self._cameras.models),
            "cameras missing": ", ".join([*self._cameras.missing, *sorted(self._cameras.refused)]) or "none",
            "late registrations": late,
            **self.skipped.counts,
        }
        if tally.solved and tally.predicted == tally.solved:
            level, text = HealthLevel.ERROR, "no camera is registered; the body is a guess"
        elif tally.predicted or late or self.skipped.counts:
            level, text = HealthLevel.WARN, "solving, with losses"
        else:
            level, text = HealthLevel.OK, "solving"
        return [Health("skeleton_solver", level, text, values)]


def main() -> int:
    """Run the node until it is stopped; its exit code."""
    return run(SkeletonSolver, "skeleton_solver")
