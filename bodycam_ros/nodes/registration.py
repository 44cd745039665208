"""Node ``registration``: the feature tracks of all cameras in, poses and landmarks in the map out (A 4.1)."""

from collections import defaultdict
from functools import partial
from pathlib import Path

from bodycam_ros.body.body_file import read_body
from bodycam_ros.messages.factory import Message
from bodycam_ros.messages.map_points import map_points_message
from bodycam_ros.messages.registration_health import RegistrationHealth
from bodycam_ros.messages.status import Health, HealthLevel
from bodycam_ros.messages.tracks import camera_pose_message, landmarks_message, track_frame
from bodycam_ros.nodes.camera_topics import CameraModels
from bodycam_ros.nodes.flow_of_frames import MissedFrames
from bodycam_ros.nodes.parameters import RegistrationParameters
from bodycam_ros.nodes.qos import STAGE_DEPTH, latched, reliable
from bodycam_ros.nodes.run import run
from bodycam_ros.nodes.stage_node import StageNode
from bodycam_ros.pipeline import registrar
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.registration.registrar import Registrar
from bodycam_ros.tracking.track_frame import TrackFrame

GROUPS = ("registrar", "matching", "absolute_pose", "pose_fit")


class Registration(StageNode[RegistrationParameters]):
    """Registers all cameras; one registrar for each, over one map.

    Track frames that come before their camera's camera_info wait for it.
    """

    def __init__(self) -> None:
        super().__init__("registration", RegistrationParameters, GROUPS)
        self.map = ReferenceMap.load(Path(self.required("map")))
        cameras = self.parameters.cameras or tuple(read_body(Path(self.required("body"))).mounts)
        self._registrars: dict[str, Registrar] = {}
        self._waiting: defaultdict[str, list[TrackFrame]] = defaultdict(list)
        self._health = RegistrationHealth(cameras)
        self._missed = MissedFrames()
        self._landmarks = {
            camera: self.publisher("bodycam_msgs/msg/LandmarkMatches", f"{camera}/landmarks", reliable(STAGE_DEPTH))
            for camera in cameras
        }
        self._poses = {
            camera: self.publisher(
                "geometry_msgs/msg/PoseWithCovarianceStamped", f"{camera}/pose", reliable(STAGE_DEPTH)
            )
            for camera in cameras
        }
        if self.parameters.publish_map:
            points = self.publisher("sensor_msgs/msg/PointCloud2", "map/points", latched())
            now_ns = self.get_clock().now().nanoseconds
            points.publish(map_points_message(self.make, now_ns, self.map.points_world, self.map.colours))
        self._cameras = CameraModels(self, cameras, self._on_camera)
        for camera in cameras:
            self.subscription(
                "bodycam_msgs/msg/FeatureTracks",
                f"{camera}/tracks",
                partial(self._on_tracks, camera),
                reliable(STAGE_DEPTH),
            )

    def _on_camera(self, camera: str) -> None:
        waiting = self._waiting.pop(camera, [])
        if camera in self._cameras.models:
            self._registrars[camera] = registrar(self._cameras.models[camera], self.map, self.settings)
            for frame in waiting:
                self._register(frame)

    def _on_tracks(self, camera: str, message: Message) -> None:
        try:
            frame = track_frame(message, camera)
        except ValueError as error:
            self.skipped.add("track messages skipped", f"{camera}/tracks: malformed message ({error})")
            return
        if camera in self._registrars:
            self._register(frame)
        elif camera not in self._cameras.refused:
            self._wait(frame)

    def _wait(self, frame: TrackFrame) -> None:
        waiting = self._waiting[frame.camera]
        waiting.append(frame)
        if len(waiting) > STAGE_DEPTH:
            del waiting[0]
            self.skipped.add(
                "track messages skipped", f"camera {frame.camera}: tracks, but no {frame.camera}/camera_info"
            )

    def _register(self, frame: TrackFrame) -> None:
        if self._missed.add(frame.camera, frame.stamp_ns, frame.previous_stamp_ns):
            self.skipped.add(
                "track messages lost", f"camera {frame.camera}: the track message before {frame.stamp_ns} ns is lost"
            )
        matches = self._registrars[frame.camera].register(frame)
        self._landmarks[frame.camera].publish(landmarks_message(self.make, matches))
        pose = camera_pose_message(self.make, matches)
        if pose is not None:
            self._poses[frame.camera].publish(pose)
        self._health.add(matches)
        self.report_when_due(frame.stamp_ns, self._report)

    def _report(self) -> list[Health]:
        level = HealthLevel.WARN if self.skipped.counts or self._cameras.refused else HealthLevel.OK
        values: dict[str, object] = {
            "cameras": len(self._registrars),
            "cameras refused": ", ".join(sorted(self._cameras.refused)) or "none",
            "landmarks in the map": len(self.map.landmark_ids),
            **self.skipped.counts,
        }
        text = "registering" if level == HealthLevel.OK else "registering, with losses"
        # Several of these nodes may share the cameras.
        return [Health(self.get_name(), level, text, values), *self._health.report()]


def main() -> int:
    """Run the node until it is stopped; its exit code."""
    return run(Registration, "registration")
