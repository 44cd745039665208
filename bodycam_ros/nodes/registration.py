"""Node ``registration``: the feature tracks of all cameras in, poses and landmarks in the map out (A 4.1)."""

from collections import defaultdict
from functools import partial
from pathlib import Path

from std_srvs.srv import SetBool

from bodycam_ros.body.body_file import read_body
from bodycam_ros.live.live_registration import LiveRegistration
from bodycam_ros.live.node_parameters import REGISTRATION_GROUPS, RegistrationParameters
from bodycam_ros.live.unanswered_frames import ReaderWait
from bodycam_ros.messages.diagnostics import Status
from bodycam_ros.messages.factory import Message
from bodycam_ros.messages.timing import TIMING, TIMING_TYPE, camera_timing
from bodycam_ros.messages.tracks import (
    LANDMARKS_TYPE,
    TRACKS_TYPE,
    camera_pose_message,
    landmarks_message,
    map_points_message,
    track_frame,
)
from bodycam_ros.moments import Moment
from bodycam_ros.nodes.camera_topics import CameraModels
from bodycam_ros.nodes.parameters import STAGE_DEPTH, latched, reliable
from bodycam_ros.nodes.stage_node import Stage, StageNode
from bodycam_ros.registration.reference_map import ASSUMED_VERTICAL, load_map
from bodycam_ros.tracking.track_frame import TrackFrame

_POLL_S, _SAVE_POLL_S = 0.1, 0.2
_TIMINGS = 10
"""Those of all who publish the timing of one camera."""

_POSE = "geometry_msgs/msg/PoseWithCovarianceStamped"


class RegistrationStage(Stage[RegistrationParameters]):
    """Registers all cameras in one map.

    Track frames wait for their camera's camera_info, and the first ones for the readers of the landmarks: two nodes may
    take seconds to find each other, and landmarks without a reader are lost for good. Registration restarts after the
    node was inactive; the grown map stays.
    """

    name, parameters_type, groups = "registration", RegistrationParameters, REGISTRATION_GROUPS

    def __init__(self, node: StageNode[RegistrationParameters]) -> None:
        super().__init__(node)
        of = self.parameters
        self._map_path = Path(self.required("map"))
        self.map = load_map(self._map_path)
        if not self.map.gravity_aligned:
            self.log.warning(f"{self._map_path}: {ASSUMED_VERTICAL}")
        cameras = of.cameras or tuple(read_body(Path(self.required("body"))).mounts)
        # Each registration grows a map of its own; several may have the same parameters.
        stored = Path(of.grown_map, node.get_fully_qualified_name().strip("/")) if of.grown_map else None
        self.live = LiveRegistration(
            self.map,
            self._map_path,
            stored,
            cameras,
            lambda: self.settings,
            self.dropped,
            self.log.error,
            self._request_keyframe,
            # The map grows by frames from before the node became inactive, too.
            partial(self.call_later, even_inactive=True),
        )
        self._waiting: defaultdict[str, list[TrackFrame]] = defaultdict(list)
        self._readers = ReaderWait()
        deep, one = reliable(STAGE_DEPTH), reliable(1)
        self._landmarks = {each: self.publisher(LANDMARKS_TYPE, f"{each}/landmarks", deep) for each in cameras}
        self._poses = {each: self.publisher(_POSE, f"{each}/pose", deep) for each in cameras}
        self._requests = {each: self.publisher("std_msgs/msg/Empty", f"{each}/want_keyframe", one) for each in cameras}
        points = of.publish_map
        self._points = self.publisher("sensor_msgs/msg/PointCloud2", "map/points", latched()) if points else None
        for each in cameras:
            set_timing, add_tracks = partial(self._set_timing, each), partial(self._add_tracks, each)
            self.subscription(TIMING_TYPE, f"{each}{TIMING}", set_timing, latched(_TIMINGS), even_inactive=True)
            self.subscription(TRACKS_TYPE, f"{each}/tracks", add_tracks, deep)
        # Last: a node whose subscription to camera_info is discovered reads the rest too.
        self._cameras = CameraModels(self, cameras, self._set_model)
        self.every(_POLL_S, self._poll)
        self.every(_SAVE_POLL_S, lambda: self.live.stored.poll(self.parameters.save_interval), even_inactive=True)
        grown_map = self.live.stored
        self.trigger("~/reset", self._reset)
        self.trigger("~/save_map", lambda: (True, grown_map.save()))
        self.trigger("~/load_map", lambda: (True, grown_map.load()))
        self.trigger("~/reset_map", lambda: (True, grown_map.reset()))
        self.service(SetBool, "~/grow", lambda request: (True, grown_map.set_growth(bool(request.data))))

    def activate(self) -> None:
        """Publish the map."""
        if self._points is not None:
            now_ns = self.node.get_clock().now().nanoseconds
            self._points.publish(map_points_message(self.make, now_ns, self.map.points_world, self.map.colours))

    def pause(self) -> None:
        """Forget the tracks, for the frames until the node is active again are missing."""
        self._waiting.clear()
        self.live.restart()

    def finish(self) -> None:
        """Save the grown map."""
        self.live.stored.close()

    def settings_changed(self) -> None:
        """Use the current thresholds for the next frames."""
        self.live.update_settings()

    def _reset(self) -> tuple[bool, str]:
        count = self.live.restart()
        return True, f"{count} cameras restart; added landmarks stay in the map (~/reset_map drops them)"

    def _request_keyframe(self, camera: str) -> None:
        self._requests[camera].publish(self.make("std_msgs/msg/Empty"))

    def _set_model(self, camera: str) -> None:
        model = self._cameras.models.get(camera)
        self.live.set_model(camera, model)
        if model is not None:
            self._register_waiting(camera)
        else:
            self._waiting.pop(camera, None)

    def _set_timing(self, camera: str, message: Message) -> None:
        try:
            self.live.set_timing(camera, camera_timing(message))
        except ValueError as error:
            self.dropped.add("timing messages dropped", f"{camera}/timing: {error}")

    def _add_tracks(self, camera: str, message: Message) -> None:
        try:
            frame = track_frame(message, camera)
        except ValueError as error:
            self.dropped.add("track messages dropped", f"{camera}/tracks: malformed message ({error})")
            return
        self.moments.note(Moment.TRACKS_RECEIVED, camera, frame.stamp_ns)
        if camera in self._cameras.rejected:
            return
        waiting = self._waiting[camera]
        waiting.append(frame)
        if len(waiting) > STAGE_DEPTH:
            del waiting[0]
            self.dropped.add("track messages dropped", f"camera {camera}: tracks, but no {camera}/camera_info")
        self._register_waiting(camera)

    def _poll(self) -> None:
        for camera in list(self._waiting):
            self._register_waiting(camera)

    def _register_waiting(self, camera: str) -> None:
        """Register the frames of a camera that wait, unless they must wait longer."""
        if camera not in self.live.cameras or camera not in self._waiting:
            return
        of, readers = self.parameters, self._landmarks[camera].get_subscription_count
        if self._readers.is_over(camera, readers, of.landmark_readers, of.landmark_wait):
            for frame in self._waiting.pop(camera):
                self._register(frame)

    def _register(self, frame: TrackFrame) -> None:
        matches = self.live.register(frame)
        landmarks = landmarks_message(self.make, matches)
        self._landmarks[frame.camera].publish(landmarks)
        self.moments.note(Moment.REGISTERED, frame.camera, frame.stamp_ns)
        pose = camera_pose_message(self.make, landmarks)
        if pose is not None:
            self._poses[frame.camera].publish(pose)

    def report(self) -> list[Status]:
        """Status of the cameras since the last report."""
        return self.live.report(self._cameras, tuple(self._waiting))


make = partial(StageNode, RegistrationStage)
"""Constructor of the node."""
