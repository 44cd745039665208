"""Node ``tracker``: the images of one camera in, feature tracks out (A 4.1, the first half)."""

from collections import deque
from dataclasses import dataclass

from rclpy.subscription import Subscription

from bodycam_ros.camera.camera_image import decode_grey
from bodycam_ros.errors import RecordingError, SettingsError
from bodycam_ros.messages.factory import Message
from bodycam_ros.messages.header import stamp_ns
from bodycam_ros.messages.images import camera_model, compressed_image, raw_image
from bodycam_ros.messages.status import Health, HealthLevel
from bodycam_ros.messages.tracks import landmark_matches, tracks_message
from bodycam_ros.nodes.camera_topics import ImageSource
from bodycam_ros.nodes.flow_of_frames import AnsweredFrames
from bodycam_ros.nodes.parameters import TrackerParameters
from bodycam_ros.nodes.qos import STAGE_DEPTH, reliable
from bodycam_ros.nodes.run import run
from bodycam_ros.nodes.stage_node import StageNode
from bodycam_ros.pipeline import feature_tracker
from bodycam_ros.tracking.feature_tracker import FeatureTracker

GROUPS = ("tracker", "keypoints", "flow", "rotation")
_CONVERTERS = {"compressed": compressed_image, "raw": raw_image}
_INFO_DEPTH = 10
_LOOK_S = 0.25


@dataclass
class _Tally:
    images: int = 0
    tracks: int = 0
    keyframes: int = 0


class Tracker(StageNode[TrackerParameters]):
    """Tracks the features of one camera.

    Images wait, up to ``image_queue`` of them, until the camera_info is here and somebody reads the tracks: a track
    that nobody heard of is lost for good.
    """

    def __init__(self) -> None:
        super().__init__("tracker", TrackerParameters, GROUPS)
        self.camera = self.required("camera")
        transport = self.parameters.transport
        if transport not in _CONVERTERS:
            raise SettingsError(f"the parameter 'transport' must be {' or '.join(_CONVERTERS)}, not '{transport}'")
        self._convert = _CONVERTERS[transport]
        self._tracker: FeatureTracker | None = None
        self._waiting: deque[Message] = deque()
        self._answers = AnsweredFrames(self.parameters.most_ahead)
        self._tally = _Tally()
        self._tracks = self.publisher("bodycam_msgs/msg/FeatureTracks", f"{self.camera}/tracks", reliable(STAGE_DEPTH))
        self._info: Subscription | None = self.subscription(
            "sensor_msgs/msg/CameraInfo", f"{self.camera}/camera_info", self._on_info, reliable(_INFO_DEPTH)
        )
        self.subscription(
            "bodycam_msgs/msg/LandmarkMatches", f"{self.camera}/landmarks", self._on_landmarks, reliable(STAGE_DEPTH)
        )
        self._source = ImageSource(self, self.camera, transport, self.parameters.image_queue, self._on_image)
        # A reader of the tracks may come when no further image does.
        self.every(_LOOK_S, self._track_next)

    def _on_info(self, message: Message) -> None:
        if self._tracker is None:
            self._tracker = feature_tracker(camera_model(message, self.camera), self.settings)
            self.soon(self._track_next)

    def _on_image(self, message: Message) -> None:
        if len(self._waiting) == self.parameters.image_queue:
            self._waiting.popleft()
            self.skipped.add("images dropped", f"camera {self.camera}: {self._what_is_lacking()}; an image is dropped")
        self._waiting.append(message)
        self.soon(self._track_next)

    def _what_is_lacking(self) -> str:
        if self._tracker is None:
            return f"there is no {self.camera}/camera_info"
        if not self._is_heard():
            return f"nobody reads {self.camera}/tracks"
        return "images come faster than they are tracked and registered"

    def _is_heard(self) -> bool:
        return bool(self._tracks.get_subscription_count())

    def _track_next(self) -> None:
        if self._tracker is None or not self._is_heard() or self._answers.must_wait():
            return
        if self._waiting:
            self._track(self._tracker, self._waiting.popleft())
            # One image at a time, so that landmarks are heard in between however many images wait.
            self.soon(self._track_next)

    def _track(self, tracker: FeatureTracker, message: Message) -> None:
        try:
            image = self._convert(message, self.camera)
            frame = tracker.track(decode_grey(image), image.stamp_ns)
        except RecordingError as error:
            self.skipped.add("images skipped", str(error))
        else:
            self._tracks.publish(tracks_message(self.make, frame))
            self._answers.sent(frame.stamp_ns)
            self._tally.images += 1
            self._tally.tracks += len(frame.track_ids)
            self._tally.keyframes += frame.keyframe
        self.report_when_due(stamp_ns(message.header.stamp), self._health)

    def _on_landmarks(self, message: Message) -> None:
        if self._tracker is None:
            return
        try:
            matches = landmark_matches(message, self.camera)
        except ValueError as error:
            self.skipped.add("landmarks skipped", f"{self.camera}/landmarks: malformed message ({error})")
            return
        if matches.world_T_camera is not None:
            self._tracker.prune(matches.stamp_ns, matches.track_ids)
        self._answers.answered(matches.stamp_ns)
        self.soon(self._track_next)

    def _health(self) -> list[Health]:
        tally, self._tally = self._tally, _Tally()
        values: dict[str, object] = {
            "images": tally.images,
            "tracks per image": round(tally.tracks / max(1, tally.images), 1),
            "keyframes": tally.keyframes,
            **self.skipped.counts,
        }
        level = HealthLevel.WARN if self.skipped.counts else HealthLevel.OK
        text = "tracking, but some input was left out" if self.skipped.counts else "tracking"
        return [Health(f"tracker {self.camera}", level, text, values)]


def main() -> int:
    """Run the node until it is stopped; its exit code."""
    return run(Tracker, "tracker")
