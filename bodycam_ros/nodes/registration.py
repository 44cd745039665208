"""Node ``registration``: the feature tracks of all cameras in, poses and landmarks in the map out (A 4.1)."""

import time
from collections import defaultdict
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

from std_srvs.srv import SetBool

from bodycam_ros.body.body_file import read_body
from bodycam_ros.camera.readout import Readout, best_known
from bodycam_ros.camera_registrar import registrar
from bodycam_ros.growth.live_growth import LiveGrowth
from bodycam_ros.live.flow_of_frames import AwaitedReaders, MissedFrames
from bodycam_ros.live.kept_map import KeptMap
from bodycam_ros.live.map_extension import MapExtension
from bodycam_ros.live.node_parameters import REGISTRATION_GROUPS, RegistrationParameters
from bodycam_ros.live.work import Work
from bodycam_ros.messages.factory import Message
from bodycam_ros.messages.health import RegistrationHealth
from bodycam_ros.messages.map_points import map_points_message
from bodycam_ros.messages.status import Health, HealthLevel, few
from bodycam_ros.messages.timing import camera_timing
from bodycam_ros.messages.tracks import camera_pose_message, landmarks_message, track_frame
from bodycam_ros.moments import Moment
from bodycam_ros.nodes.camera_topics import CameraModels
from bodycam_ros.nodes.qos import STAGE_DEPTH, latched, reliable
from bodycam_ros.nodes.stage_node import Stage, StageNode
from bodycam_ros.registration.loaded_map import load_map
from bodycam_ros.registration.reference_map import assumed_vertical, check_metric
from bodycam_ros.registration.registrar import Registrar
from bodycam_ros.tracking.track_frame import TrackFrame

_LOOK_S, _SAVE_LOOK_S = 0.1, 0.2

_TIMINGS = 10
"""Those of all who speak of one camera."""


class RegistrationStage(Stage[RegistrationParameters]):
    """Registers all cameras; one registrar for each, over one map, which grows by what they see.

    Track frames that come before their camera's camera_info wait for it, and the first ones for those who are to read
    what is made of them: two nodes may take seconds to find each other, and landmarks that nobody heard of are lost for
    good. Where a tracker begins anew, so does the registrar; where this node comes into the middle of a tracker's
    stream, it asks for a keyframe, because only there the tracks carry what they can be named by. It does so as well
    after it was inactive; the map with all that has grown is kept.
    """

    name, parameters_type, groups = "registration", RegistrationParameters, REGISTRATION_GROUPS
    action = "bodycam_msgs/action/ExtendMap", "~/extend_map"

    def __init__(self, node: StageNode[RegistrationParameters]) -> None:
        super().__init__(node)
        map_path = Path(self.required("map"))
        self.map = load_map(map_path)
        check_metric(self.map, map_path)
        if assumed := assumed_vertical(self.map, map_path):
            self.log.warning(assumed)
        self._growth = LiveGrowth(self.map, self.settings.growth, self._want_keyframe, self._soon)
        kept = self.parameters.grown_map
        # Several registrations grow their own, and may be given the same parameters.
        folder = Path(kept, node.get_fully_qualified_name().strip("/")) if kept else None
        self._kept = KeptMap(self._growth, self.map, map_path, folder, self.log.error)
        self._map_path = map_path
        self._extension: MapExtension | None = None
        cameras = self.parameters.cameras or tuple(read_body(Path(self.required("body"))).mounts)
        self._registrars: dict[str, Registrar] = {}
        self._described: set[str] = set()
        self._latest_ns: dict[str, int] = {}
        self._waiting: defaultdict[str, list[TrackFrame]] = defaultdict(list)
        self._readers = AwaitedReaders()
        self._registration_health = RegistrationHealth(cameras, self.settings.readout)
        self._missed = MissedFrames()
        self._frames, self._work_s = 0, 0.0
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
        self._requests = {
            camera: self.publisher("std_msgs/msg/Empty", f"{camera}/want_keyframe", reliable(1)) for camera in cameras
        }
        shows = self.parameters.publish_map
        self._points = self.publisher("sensor_msgs/msg/PointCloud2", "map/points", latched()) if shows else None
        self._readouts: defaultdict[str, dict[str, Readout]] = defaultdict(dict)
        for camera in cameras:
            self.subscription(
                "bodycam_msgs/msg/CameraTiming",
                f"{camera}/timing",
                partial(self._on_timing, camera),
                latched(_TIMINGS),
                even_inactive=True,
            )
            self.subscription(
                "bodycam_msgs/msg/FeatureTracks",
                f"{camera}/tracks",
                partial(self._on_tracks, camera),
                reliable(STAGE_DEPTH),
            )
        # The last: who sees it reading camera_info may take it that it reads the rest.
        self._cameras = CameraModels(self, cameras, self._on_camera)
        self.every(_LOOK_S, self._look)
        self.every(_SAVE_LOOK_S, lambda: self._kept.look(self.parameters.save_interval), even_inactive=True)
        self.trigger("~/reset", self._reset)
        self.trigger("~/save_map", lambda: (True, self._kept.save()))
        self.trigger("~/load_map", lambda: (True, self._kept.load()))
        self.trigger("~/reset_map", lambda: (True, self._kept.reset()))
        self.service(SetBool, "~/grow", lambda request: (True, self._kept.grow(bool(request.data))))

    def begin(self) -> None:
        """Show the map."""
        if self._points is not None:
            now_ns = self.node.get_clock().now().nanoseconds
            self._points.publish(map_points_message(self.make, now_ns, self.map.points_world, self.map.colours))

    def pause(self) -> None:
        """What the trackers say meanwhile is missing, so what is known of their tracks is of no use."""
        self._stop_work()
        self._waiting.clear()
        self._missed = MissedFrames()
        self._begin_all()

    def _begin_all(self) -> int:
        for camera in self._registrars:
            self._begin(camera)
        return len(self._registrars)

    def _reset(self) -> tuple[bool, str]:
        return True, f"{self._begin_all()} cameras begin anew; what the map has grown by is kept (~/reset_map drops it)"

    def _soon(self, callback: Callable[[], None]) -> None:
        # The map grows by what was seen while the node was active, whatever it is by then.
        self.soon(callback, even_inactive=True)

    def _on_camera(self, camera: str) -> None:
        self._registrars.pop(camera, None)
        if camera in self._cameras.models:
            self._begin(camera)
            self._go_on(camera)
        else:
            self._waiting.pop(camera, None)

    def _look(self) -> None:
        for camera in list(self._waiting):
            self._go_on(camera)

    def _go_on(self, camera: str) -> None:
        """Register what waits, unless it has to wait for longer."""
        if camera in self._registrars and camera in self._waiting and self._is_read(camera):
            for frame in self._waiting.pop(camera):
                self._register(frame)

    def _is_read(self, camera: str) -> bool:
        of, readers = self.parameters, self._landmarks[camera].get_subscription_count
        return self._readers.are_there(camera, readers, of.landmark_readers, of.landmark_wait)

    def _begin(self, camera: str) -> None:
        """Nothing is known of the camera's tracks."""
        known = best_known(*self._readouts[camera].values())
        model = self._cameras.models[camera]
        self._registrars[camera] = registrar(model, self._growth.map, self.settings, known)
        self._growth.begin(camera, model)
        self._described.discard(camera)

    def settings_changed(self) -> None:
        """Register the next images by the thresholds that hold now."""
        for each in self._registrars.values():
            each.settings = self.settings.registrar

    def _on_timing(self, camera: str, message: Message) -> None:
        """Camera and body may both say how long the rows are read out; the better known counts."""
        try:
            timing = camera_timing(message)
        except ValueError as error:
            self.skipped.add("timing messages skipped", f"{camera}/timing: {error}")
            return
        if timing.readout is None:
            return
        self._readouts[camera][timing.source] = timing.readout
        if camera in self._registrars:
            self._registrars[camera].learn(timing.readout)

    def _on_tracks(self, camera: str, message: Message) -> None:
        try:
            frame = track_frame(message, camera)
        except ValueError as error:
            self.skipped.add("track messages skipped", f"{camera}/tracks: malformed message ({error})")
            return
        self.moments.note(Moment.TRACKS_HEARD, camera, frame.stamp_ns)
        if camera not in self._cameras.refused:
            self._wait(frame)
            self._go_on(camera)

    def _wait(self, frame: TrackFrame) -> None:
        waiting = self._waiting[frame.camera]
        waiting.append(frame)
        if len(waiting) > STAGE_DEPTH:
            del waiting[0]
            self.skipped.add(
                "track messages skipped", f"camera {frame.camera}: tracks, but no {frame.camera}/camera_info"
            )

    def _register(self, frame: TrackFrame) -> None:
        started_s = time.monotonic()
        camera = frame.camera
        # Another tracker, or another time: its track ids begin anew, and are not those that are known.
        if frame.previous_stamp_ns == 0 or frame.stamp_ns <= self._latest_ns.get(camera, 0):
            self._begin(camera)
        self._latest_ns[camera] = frame.stamp_ns
        if self._missed.add(camera, frame.stamp_ns, frame.previous_stamp_ns):
            self._described.discard(camera)
            self.skipped.add(
                "track messages lost", f"camera {camera}: the track message before {frame.stamp_ns} ns is lost"
            )
        if frame.keyframe:
            self._described.add(camera)
        elif camera not in self._described:
            self._want_keyframe(camera)
        matches = self._registrars[camera].register(frame)
        self._landmarks[camera].publish(landmarks_message(self.make, matches))
        self.moments.note(Moment.REGISTERED, camera, frame.stamp_ns)
        pose = camera_pose_message(self.make, matches)
        if pose is not None:
            self._poses[camera].publish(pose)
        self._registration_health.add(matches)
        self._growth.hear(frame, matches)
        self._frames += 1
        self._work_s += time.monotonic() - started_s

    def _want_keyframe(self, camera: str) -> None:
        self._requests[camera].publish(self.make("std_msgs/msg/Empty"))

    def work_on(self, goal: Message) -> Work:
        """For the action ~/extend_map."""
        self._extension = MapExtension(self._map_path, goal.recording, goal.output, self.settings.as_mapping())
        return self._extension

    def _stop_work(self) -> None:
        if self._extension is not None:
            self._extension.stop()
        if self.node.action is not None:
            self.node.action.stop()

    def finish(self) -> None:
        """Save what has grown before the node goes."""
        self._stop_work()
        self._kept.stop()

    def health(self) -> list[Health]:
        """How the cameras fared in the last second; several of these nodes may share them."""
        frames, work_s, self._frames, self._work_s = self._frames, self._work_s, 0, 0.0
        lost = self.skipped.lately()
        missing = self._cameras.missing
        values: dict[str, object] = {
            "frames per second": frames,
            "time per frame [ms]": round(1e3 * work_s / frames, 1) if frames else "none",
            "cameras": len(self._registrars),
            "cameras refused": ", ".join(sorted(self._cameras.refused)) or "none",
            "cameras without camera_info": ", ".join(missing) or "none",
            "camera_info changed": self._cameras.changes,
            "landmarks in the map": len(self.map.landmark_ids),
            **self.skipped.counts,
            "last error": self.skipped.latest or "none",
        }
        if unknown := [camera for camera in missing if self._waiting.get(camera)]:
            level, text = HealthLevel.ERROR, f"tracks, but no camera_info of {few(unknown)}"
        elif self._cameras.refused:
            level, text = HealthLevel.ERROR, f"no usable camera_info of {few(sorted(self._cameras.refused))}"
        elif self._waiting:
            level, text = HealthLevel.WARN, f"waits until more nodes read the landmarks of {few(sorted(self._waiting))}"
        elif lost:
            level, text = HealthLevel.WARN, f"registering, with losses: {self.skipped.latest}"
        elif frames:
            level, text = HealthLevel.OK, "registering"
        else:
            level, text = HealthLevel.STALE, "no tracks come"
        everybody = Health("all cameras", level, text, values)
        of_cameras = self._registration_health.report()
        return [everybody, self._kept.health(), *self._of_extension(), *of_cameras]

    def _of_extension(self) -> list[Health]:
        if self._extension is None or self._extension.result is not None:
            return []
        values: dict[str, object] = {"step": self._extension.step, "done [%]": round(100 * self._extension.share)}
        return [Health("map extension", HealthLevel.OK, "extending", values)]


def make(arguments: Sequence[str] = ()) -> StageNode[RegistrationParameters]:
    """The node."""
    return StageNode(RegistrationStage, arguments)
