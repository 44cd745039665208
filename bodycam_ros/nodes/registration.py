"""Node ``registration``: the feature tracks of all cameras in, poses and landmarks in the map out (A 4.1)."""

import time
from collections import defaultdict
from dataclasses import replace
from functools import partial
from pathlib import Path

import bodycam_ros.registration.relocalisation  # noqa: F401  it loads pycolmap, which only the main thread may
from bodycam_ros.body.body_file import read_body
from bodycam_ros.camera.readout import Readout, best_known
from bodycam_ros.diagnostics.camera_diagnostics import RegistrationDiagnostics
from bodycam_ros.diagnostics.dropped_messages import LostMessages
from bodycam_ros.files.shown import few
from bodycam_ros.graph.live_mapper import LiveMapper
from bodycam_ros.graph.node_parameters import REGISTRATION_GROUPS, RegistrationParameters
from bodycam_ros.messages.diagnostics import Status, StatusLevel
from bodycam_ros.messages.factory import Message
from bodycam_ros.messages.timing import TIMING, TIMING_TYPE, readout_time
from bodycam_ros.messages.tracks import (
    LANDMARKS_TYPE,
    TRACKS_TYPE,
    camera_pose_message,
    landmarks_message,
    map_points_message,
    track_frame,
)
from bodycam_ros.nodes.camera_topics import CameraModels
from bodycam_ros.nodes.gathered_lines import GatheredLines
from bodycam_ros.nodes.moments import Moment
from bodycam_ros.nodes.parameters import STAGE_DEPTH, latched, reliable
from bodycam_ros.nodes.stage_node import Stage, StageNode
from bodycam_ros.pipeline.camera_front import CameraFront
from bodycam_ros.registration.landmark_matches import LandmarkMatches, unregistered
from bodycam_ros.registration.map_identity import MapIdentity
from bodycam_ros.registration.reference_map import ASSUMED_VERTICAL, load_map
from bodycam_ros.tracking.track_frame import TrackFrame

_POLL_S, _SAVE_POLL_S = 0.1, 0.2
_TIMINGS = 10
"""Queue of the messages of all who publish the timing of one camera."""

_POSE = "geometry_msgs/msg/PoseWithCovarianceStamped"


class RegistrationStage(Stage[RegistrationParameters]):
    """Registers all cameras in one map, which they extend: a registrar for each, which restarts with its tracker.

    Track frames wait for their camera's camera_info, and the first ones for the readers of the landmarks: two nodes may
    take seconds to find each other, and landmarks without a reader are lost for good. Registration restarts after the
    node was inactive; the grown map stays. For frames from the middle of a tracker's stream a keyframe is requested,
    because only keyframes have the descriptors by which tracks are matched to landmarks.

    Attributes:
        map: as it was read.
        fronts: by camera.
    """

    name = "registration"
    parameters_type = RegistrationParameters
    groups = REGISTRATION_GROUPS

    def __init__(self, node: StageNode[RegistrationParameters]) -> None:
        super().__init__(node)
        of = self.parameters
        map_path = Path(self.required("map"))
        self.map = load_map(map_path)
        if not self.map.gravity_aligned:
            self.log.warning(f"{map_path}: {ASSUMED_VERTICAL}")
        self._map_path = map_path
        self._other_maps: dict[str, MapIdentity] = {}  # of cameras whose tracks are another map's
        self._refused: set[str] = set()  # of these, the cameras with tracks since the last report
        self._lines = GatheredLines(self)
        cameras = of.cameras or tuple(read_body(Path(self.required("body"))).mounts)
        # The map grows by frames from before the node became inactive, too.
        defer = partial(self.call_later, even_inactive=True)
        extension = self.settings.extension
        self._mapper = LiveMapper(self.map, extension, self._request_keyframe, defer, self.log.error)
        if of.grown_map:
            # Each registration grows a map of its own; several may have the same parameters.
            self._mapper.keep_in(Path(of.grown_map, node.get_fully_qualified_name().strip("/")), map_path)
        self.fronts: dict[str, CameraFront] = {}
        self._readouts: defaultdict[str, dict[str, Readout]] = defaultdict(dict)
        self._described: set[str] = set()
        self._latest_ns: dict[str, int] = {}
        self._lost = LostMessages()
        self._diagnostics = RegistrationDiagnostics(cameras)
        self._frames, self._work_s = 0, 0.0
        self._waiting: defaultdict[str, list[TrackFrame]] = defaultdict(list)
        self._waiting_since_s: dict[str, float] = {}
        self._has_readers: set[str] = set()
        deep, one = reliable(STAGE_DEPTH), reliable(1)
        self._landmarks = {each: self.publisher(LANDMARKS_TYPE, f"{each}/landmarks", deep) for each in cameras}
        self._poses = {each: self.publisher(_POSE, f"{each}/pose", deep) for each in cameras}
        self._requests = {each: self.publisher("std_msgs/msg/Empty", f"{each}/want_keyframe", one) for each in cameras}
        points = of.publish_map
        self._points = self.publisher("sensor_msgs/msg/PointCloud2", "map/points", latched()) if points else None
        for each in cameras:
            timed = TIMING_TYPE, f"{each}{TIMING}", partial(self._set_readout, each), latched(_TIMINGS)
            self.subscription(*timed, _readout_by_source, "timing messages dropped", even_inactive=True)
            tracked = TRACKS_TYPE, f"{each}/tracks", partial(self._add_tracks, each), deep
            self.subscription(*tracked, partial(track_frame, camera=each), "track messages dropped")
        # Last: a node whose subscription to camera_info is discovered reads the rest too.
        self._cameras = CameraModels(self, cameras, self._set_model)
        self.every(_POLL_S, self._poll)
        self.every(_SAVE_POLL_S, lambda: self._mapper.poll(self.parameters.save_interval), even_inactive=True)
        self.trigger("~/reset", self._reset)

    def activate(self) -> None:
        """Publish the map."""
        if self._points is not None:
            now_ns = self.node.get_clock().now().nanoseconds
            self._points.publish(map_points_message(self.make, now_ns, self.map.points_world, self.map.colours))

    def pause(self) -> None:
        """Forget the tracks, for the frames until the node is active again are missing."""
        self._waiting.clear()
        self._restart()

    def finish(self) -> None:
        """Save the grown map."""
        self._mapper.close()

    def settings_changed(self) -> None:
        """Use the current thresholds for the next frames."""
        for each in self.fronts.values():
            each.set_registrar(self.settings.registrar)

    def _restart(self) -> None:
        """Forget the tracks of all cameras."""
        self._lost = LostMessages()
        for camera in self.fronts:
            self._restart_camera(camera)

    def _restart_camera(self, camera: str) -> None:
        """Forget the tracks of a camera."""
        readout, model = best_known(*self._readouts[camera].values()), self._cameras.models[camera]
        self.fronts[camera] = CameraFront(model, self._mapper.map, self.settings, readout)
        self._mapper.start_camera(camera, model)
        self._described.discard(camera)

    def _reset(self) -> str:
        self._restart()
        return f"{len(self.fronts)} cameras restart; added landmarks stay in the map"

    def _request_keyframe(self, camera: str) -> None:
        self._requests[camera].publish(self.make("std_msgs/msg/Empty"))

    def _set_model(self, camera: str) -> None:
        if camera in self._cameras.models:
            self._restart_camera(camera)
            self._register_waiting(camera)
        else:
            self.fronts.pop(camera, None)
            self._waiting.pop(camera, None)

    def _set_readout(self, camera: str, given: tuple[str, Readout | None]) -> None:
        source, readout = given
        if readout is not None:
            # Several sources may tell it; the best known counts.
            self._readouts[camera][source] = readout
            if camera in self.fronts:
                self.fronts[camera].set_readout(readout)

    def _add_tracks(self, camera: str, frame: TrackFrame) -> None:
        self.moments.note(Moment.TRACKS_RECEIVED, camera, frame.stamp_ns)
        if camera in self._cameras.rejected:
            return
        waiting = self._waiting[camera]
        waiting.append(frame)
        if len(waiting) > STAGE_DEPTH:
            del waiting[0]
            lacking = "too few nodes read its landmarks" if camera in self.fronts else f"no {camera}/camera_info"
            self.dropped.add("track messages dropped", f"camera {camera}: tracks, but {lacking}")
        self._register_waiting(camera)

    def _poll(self) -> None:
        for camera in list(self._waiting):
            self._register_waiting(camera)

    def _register_waiting(self, camera: str) -> None:
        """Register the frames of a camera that wait, unless they must wait longer."""
        if camera not in self.fronts or camera not in self._waiting:
            return
        if self._has_all_readers(camera):
            for frame in self._waiting.pop(camera):
                self._register(frame)

    def _has_all_readers(self, camera: str) -> bool:
        """Whether enough nodes read, or have read, a camera's landmarks, or did not connect in time."""
        if camera not in self._has_readers:
            now_s, of = time.monotonic(), self.parameters
            waited_s = now_s - self._waiting_since_s.setdefault(camera, now_s)
            count = self._landmarks[camera].get_subscription_count()
            if count < of.landmark_readers and waited_s <= of.landmark_wait:
                return False
            self._has_readers.add(camera)
        return True

    def _register(self, frame: TrackFrame) -> None:
        started_s = time.monotonic()
        matches = self._matches(frame)
        self._frames += 1
        self._work_s += time.monotonic() - started_s
        landmarks = landmarks_message(self.make, matches)
        self._landmarks[frame.camera].publish(landmarks)
        self.moments.note(Moment.REGISTERED, frame.camera, frame.stamp_ns)
        pose = camera_pose_message(self.make, landmarks)
        if pose is not None:
            self._poses[frame.camera].publish(pose)

    def _matches(self, frame: TrackFrame) -> LandmarkMatches:
        """Register a frame, and let the map grow by it."""
        camera = frame.camera
        # Another tracker, or time went back: its track ids are new ones.
        if frame.previous_stamp_ns == 0 or frame.stamp_ns <= self._latest_ns.get(camera, 0):
            self._restart_camera(camera)
        self._latest_ns[camera] = frame.stamp_ns
        if self._lost.add(camera, frame.stamp_ns, frame.previous_stamp_ns):
            self._described.discard(camera)
            reason = f"camera {camera}: the track message before {frame.stamp_ns} ns is lost"
            self.dropped.add("track messages lost", reason)
        if frame.keyframe:
            self._described.add(camera)
        elif camera not in self._described:
            self._request_keyframe(camera)
        if self._is_of_other_map(frame):
            matches = unregistered(frame)
        else:
            matches = self.fronts[camera].register(frame)
            self._mapper.add_image(frame, matches)
        self._diagnostics.add(matches)
        return replace(matches, map_identity=str(self._mapper.identity), tracks_map_identity=frame.map_identity)

    def _is_of_other_map(self, frame: TrackFrame) -> bool:
        """Whether tracks are those of another map, so that they must not be used."""
        camera, other = frame.camera, MapIdentity.parse(frame.map_identity)
        if not self._mapper.identity.contradicts(other):
            self._other_maps.pop(camera, None)
            return False
        if self._other_maps.get(camera) != other:
            self._other_maps[camera] = other
            self._lines.errors.append(f"camera {camera}: {self._other_map(other)}")
        self._refused.add(camera)
        self.dropped.counts["tracks of another map"] += 1
        return True

    def _other_map(self, other: MapIdentity) -> str:
        return (
            f"its tracker uses map {other}, this registration {self._map_path} ({self._mapper.identity}): its tracks "
            "are refused; start both with the same map:=MAP"
        )

    def report(self) -> list[Status]:
        """Status of all cameras, of the map and of each camera since the last report."""
        frames = self._frames
        work_s = self._work_s
        self._frames = 0
        self._work_s = 0.0
        refused = sorted(self._refused)
        self._refused.clear()
        lost = self.dropped.count_new()
        cameras = self._cameras
        missing = self._cameras.missing
        values: dict[str, object] = {
            "frames per second": frames,
            "time per frame [ms]": round(1e3 * work_s / frames, 1) if frames else "none",
            "cameras": len(self.fronts),
            "cameras rejected": ", ".join(sorted(cameras.rejected)) or "none",
            "cameras without camera_info": ", ".join(missing) or "none",
            "camera_info changed": cameras.changes,
            "map": f"{self._map_path} ({self._mapper.identity})",
            "landmarks in the map": len(self.map.landmark_ids),
            **self.dropped.values,
        }
        if refused:
            text = f"tracks of {few(refused)} are refused: {self._other_map(self._other_maps[refused[0]])}"
            level = StatusLevel.ERROR
        elif unknown := [camera for camera in missing if camera in self._waiting]:
            level, text = StatusLevel.ERROR, f"tracks, but no camera_info of {few(unknown)}"
        elif cameras.rejected:
            causes = (f"camera {camera}: {reason}" for camera, reason in sorted(cameras.rejected.items()))
            level, text = StatusLevel.ERROR, f"unusable camera_info: {few([*causes])}"
        elif self._waiting:
            level, text = StatusLevel.WARN, f"waiting for more readers of the landmarks of {few(sorted(self._waiting))}"
        elif lost:
            level, text = StatusLevel.WARN, f"registering, with losses: {self.dropped.latest}"
        elif frames:
            level, text = StatusLevel.OK, "registering"
        else:
            level, text = StatusLevel.ERROR, "no tracks arrive"
        return [Status("all cameras", level, text, values), self._mapper.report(), *self._diagnostics.report()]


def _readout_by_source(message: Message) -> tuple[str, Readout | None]:
    """Who gives a camera's read-out time, and the time."""
    return message.source, readout_time(message)


make = partial(StageNode, RegistrationStage)
"""Constructor of the node."""
