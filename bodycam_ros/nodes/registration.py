"""Node ``registration``: the feature tracks of all cameras in, poses and landmarks in the map out (A 4.1)."""

from collections import defaultdict
from functools import partial
from pathlib import Path

from std_srvs.srv import SetBool

from bodycam_ros.body.body_file import read_body
from bodycam_ros.live.flow_of_frames import AwaitedReaders
from bodycam_ros.live.live_registration import LiveRegistration
from bodycam_ros.live.node_parameters import REGISTRATION_GROUPS, RegistrationParameters
from bodycam_ros.messages.factory import Message
from bodycam_ros.messages.health import Health
from bodycam_ros.messages.timing import camera_timing
from bodycam_ros.messages.tracks import camera_pose_message, landmarks_message, map_points_message, track_frame
from bodycam_ros.moments import Moment
from bodycam_ros.nodes.camera_topics import CameraModels
from bodycam_ros.nodes.parameters import STAGE_DEPTH, latched, reliable
from bodycam_ros.nodes.stage_node import Stage, StageNode
from bodycam_ros.registration.reference_map import assumed_vertical, check_metric, load_map
from bodycam_ros.tracking.track_frame import TrackFrame

_LOOK_S, _SAVE_LOOK_S = 0.1, 0.2
_TIMINGS = 10
"""Those of all who publish the timing of one camera."""

_POSE = "geometry_msgs/msg/PoseWithCovarianceStamped"


class RegistrationStage(Stage[RegistrationParameters]):
    """Registers all cameras in one map.

    Track frames that come before their camera's camera_info wait for it, and the first ones for those who are to read
    what is made of them: two nodes may take seconds to find each other, and landmarks that nobody received are lost for
    good. After it was inactive it begins anew; the map with all that has grown is kept.
    """

    name, parameters_type, groups = "registration", RegistrationParameters, REGISTRATION_GROUPS

    def __init__(self, node: StageNode[RegistrationParameters]) -> None:
        super().__init__(node)
        of = self.parameters
        self._map_path = Path(self.required("map"))
        self.map = load_map(self._map_path)
        check_metric(self.map, self._map_path)
        if assumed := assumed_vertical(self.map, self._map_path):
            self.log.warning(assumed)
        cameras = of.cameras or tuple(read_body(Path(self.required("body"))).mounts)
        # Several registrations grow their own map, and may be given the same parameters.
        kept = Path(of.grown_map, node.get_fully_qualified_name().strip("/")) if of.grown_map else None
        self.live = LiveRegistration(
            self.map,
            self._map_path,
            kept,
            cameras,
            lambda: self.settings,
            self.skipped,
            self.log.error,
            self._want_keyframe,
            # The map grows by what was seen while the node was active, whatever it is by then.
            partial(self.soon, even_inactive=True),
        )
        self._waiting: defaultdict[str, list[TrackFrame]] = defaultdict(list)
        self._readers = AwaitedReaders()
        deep, one = reliable(STAGE_DEPTH), reliable(1)
        landmarks = "bodycam_msgs/msg/LandmarkMatches"
        self._landmarks = {each: self.publisher(landmarks, f"{each}/landmarks", deep) for each in cameras}
        self._poses = {each: self.publisher(_POSE, f"{each}/pose", deep) for each in cameras}
        self._requests = {each: self.publisher("std_msgs/msg/Empty", f"{each}/want_keyframe", one) for each in cameras}
        points = of.publish_map
        self._points = self.publisher("sensor_msgs/msg/PointCloud2", "map/points", latched()) if points else None
        for each in cameras:
            on_timing, on_tracks = partial(self._on_timing, each), partial(self._on_tracks, each)
            timing = "bodycam_msgs/msg/CameraTiming"
            self.subscription(timing, f"{each}/timing", on_timing, latched(_TIMINGS), even_inactive=True)
            self.subscription("bodycam_msgs/msg/FeatureTracks", f"{each}/tracks", on_tracks, deep)
        # The last: who sees it reading camera_info may take it that it reads the rest.
        self._cameras = CameraModels(self, cameras, self._on_camera)
        self.every(_LOOK_S, self._look)
        self.every(_SAVE_LOOK_S, lambda: self.live.kept.look(self.parameters.save_interval), even_inactive=True)
        kept_map = self.live.kept
        self.trigger("~/reset", self._reset)
        self.trigger("~/save_map", lambda: (True, kept_map.save()))
        self.trigger("~/load_map", lambda: (True, kept_map.load()))
        self.trigger("~/reset_map", lambda: (True, kept_map.reset()))
        self.service(SetBool, "~/grow", lambda request: (True, kept_map.grow(bool(request.data))))

    def begin(self) -> None:
        """Publish the map."""
        if self._points is not None:
            now_ns = self.node.get_clock().now().nanoseconds
            self._points.publish(map_points_message(self.make, now_ns, self.map.points_world, self.map.colours))

    def pause(self) -> None:
        """Frames that come meanwhile are missing, so what is known of the tracks is of no use."""
        self._waiting.clear()
        self.live.begin_anew()

    def finish(self) -> None:
        """Save what has grown before the node goes."""
        self.live.kept.stop()

    def settings_changed(self) -> None:
        """Register the next images by the thresholds that hold now."""
        self.live.settings_changed()

    def _reset(self) -> tuple[bool, str]:
        count = self.live.begin_anew()
        return True, f"{count} cameras begin anew; what the map has grown by is kept (~/reset_map drops it)"

    def _want_keyframe(self, camera: str) -> None:
        self._requests[camera].publish(self.make("std_msgs/msg/Empty"))

    def _on_camera(self, camera: str) -> None:
        model = self._cameras.models.get(camera)
        self.live.use(camera, model)
        if model is not None:
            self._go_on(camera)
        else:
            self._waiting.pop(camera, None)

    def _on_timing(self, camera: str, message: Message) -> None:
        try:
            self.live.learn(camera, camera_timing(message))
        except ValueError as error:
            self.skipped.add("timing messages skipped", f"{camera}/timing: {error}")

    def _on_tracks(self, camera: str, message: Message) -> None:
        try:
            frame = track_frame(message, camera)
        except ValueError as error:
            self.skipped.add("track messages skipped", f"{camera}/tracks: malformed message ({error})")
            return
        self.moments.note(Moment.TRACKS_HEARD, camera, frame.stamp_ns)
        if camera in self._cameras.refused:
            return
        waiting = self._waiting[camera]
        waiting.append(frame)
        if len(waiting) > STAGE_DEPTH:
            del waiting[0]
            self.skipped.add("track messages skipped", f"camera {camera}: tracks, but no {camera}/camera_info")
        self._go_on(camera)

    def _look(self) -> None:
        for camera in list(self._waiting):
            self._go_on(camera)

    def _go_on(self, camera: str) -> None:
        """Register what waits, unless it has to wait for longer."""
        if camera not in self.live.cameras or camera not in self._waiting:
            return
        of, readers = self.parameters, self._landmarks[camera].get_subscription_count
        if self._readers.are_there(camera, readers, of.landmark_readers, of.landmark_wait):
            for frame in self._waiting.pop(camera):
                self._register(frame)

    def _register(self, frame: TrackFrame) -> None:
        matches = self.live.register(frame)
        self._landmarks[frame.camera].publish(landmarks_message(self.make, matches))
        self.moments.note(Moment.REGISTERED, frame.camera, frame.stamp_ns)
        pose = camera_pose_message(self.make, matches)
        if pose is not None:
            self._poses[frame.camera].publish(pose)

    def health(self) -> list[Health]:
        """How the cameras fared in the last second."""
        return self.live.health(self._cameras, tuple(self._waiting))


make = partial(StageNode, RegistrationStage)
"""Makes the node."""
