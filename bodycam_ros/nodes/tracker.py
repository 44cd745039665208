"""Node ``tracker``: the images of one camera in, feature tracks out (A 4.1, the first half)."""

import time
from functools import partial
from pathlib import Path

from bodycam_ros.camera.camera_image import CameraImage, decode_grey
from bodycam_ros.camera_pipeline import landmark_tracker
from bodycam_ros.errors import RecordingError
from bodycam_ros.lens.lens_check import LensMonitor
from bodycam_ros.live.flow_of_frames import AnsweredFrames
from bodycam_ros.live.image_queue import ImageHealth, ImageQueue
from bodycam_ros.live.node_parameters import TRACKER_GROUPS, TrackerParameters
from bodycam_ros.messages.factory import Message
from bodycam_ros.messages.health import Health
from bodycam_ros.messages.tracks import landmark_matches, tracks_message
from bodycam_ros.moments import Moment
from bodycam_ros.nodes.camera_topics import CameraModels, ImageSource
from bodycam_ros.nodes.parameters import STAGE_DEPTH, reliable
from bodycam_ros.nodes.stage_node import Stage, StageNode
from bodycam_ros.registration.landmark_tracker import LandmarkTracker
from bodycam_ros.registration.reference_map import load_map
from bodycam_ros.tracking.every_second_image import EverySecondImage

_LOOK_S = 0.25


class TrackerStage(Stage[TrackerParameters]):
    """Tracks the features of one camera.

    Images wait, up to ``image_queue`` of them, until the camera_info is here and somebody reads the tracks: a track
    that nobody heard of is lost for good. Where the time of the images goes back, or their camera_info changes, it
    begins anew. Where images wait for too long it leaves out every second one, undecoded, until it keeps up again.
    While it is inactive it looks at none, and afterwards it begins anew.
    """

    name, parameters_type, groups = "tracker", TrackerParameters, TRACKER_GROUPS

    def __init__(self, node: StageNode[TrackerParameters]) -> None:
        super().__init__(node)
        self.camera = self.required("camera")
        self._map = load_map(Path(self.parameters.map)) if self.parameters.map else None
        self._tracker: LandmarkTracker | None = None
        self._lens: LensMonitor | None = None
        self._answers = AnsweredFrames(self.parameters.most_ahead)
        self._thinning = EverySecondImage(self.parameters.longest_wait, self.parameters.recovery)
        self._readers = 0
        self._tracks = self.publisher("bodycam_msgs/msg/FeatureTracks", f"{self.camera}/tracks", reliable(STAGE_DEPTH))
        self.subscription(
            "bodycam_msgs/msg/LandmarkMatches", f"{self.camera}/landmarks", self._on_landmarks, reliable(STAGE_DEPTH)
        )
        self.subscription("std_msgs/msg/Empty", f"{self.camera}/want_keyframe", self._on_request, reliable(1))
        of = self.parameters
        self._images = ImageQueue(
            self.camera,
            self.skipped,
            self.moments,
            of.image_queue,
            self._thinning,
            lambda: self.soon(self._track_next),
            self._what_is_lacking,
        )
        self._health = ImageHealth(self.camera, self._images, self.skipped)
        self._source = ImageSource(self, self.camera, of.transport, of.image_queue, self._images.receive)
        # The last: who sees it reading camera_info may take it that it reads the rest.
        self._models = CameraModels(self, [self.camera], self._on_camera, fatal=True)
        # A reader of the tracks may come when no further image does.
        self.every(_LOOK_S, self._look)
        self.trigger("~/reset", self._reset)

    def pause(self) -> None:
        """Who registers the tracks is told by the first image after that: it follows none."""
        self._images.forget()
        if self._tracker is not None:
            self._begin()

    def _reset(self) -> tuple[bool, str]:
        if self._tracker is None:
            return True, f"nothing is known yet: there is no {self.camera}/camera_info"
        self._health.restarts += 1
        self._begin()
        return True, f"camera {self.camera} begins anew: the next image is a keyframe without a predecessor"

    def _on_camera(self, camera: str) -> None:
        self._lens = LensMonitor(self._models.models[camera])
        self._begin()
        self.soon(self._track_next)

    def settings_changed(self) -> None:
        """Wait, and run ahead, as is said now."""
        of = self.parameters
        self._answers.most_ahead = of.most_ahead
        self._thinning.longest_wait_s, self._thinning.recovery_s = of.longest_wait, of.recovery

    def _begin(self) -> None:
        """Nothing is known of the images so far; the next is a keyframe without a predecessor."""
        self._tracker = landmark_tracker(self._models.models[self.camera], self._map, self.settings)
        self._answers.forget()
        self._thinning.forget()

    def _what_is_lacking(self) -> str:
        if self._tracker is None:
            return f"there is no {self.camera}/camera_info"
        if not self._is_heard():
            return f"nobody reads {self.camera}/tracks"
        return "images come faster than they are tracked and registered"

    def _is_heard(self) -> bool:
        readers = self._tracks.get_subscription_count()
        if readers > self._readers:
            # It may be a registration in place of one that was killed, and that answers nothing any more.
            self._answers.expect_nobody()
        self._readers = readers
        return bool(readers)

    def _look(self) -> None:
        self._images.look()
        self._track_next()

    def _track_next(self) -> None:
        if self._tracker is None or not self._is_heard() or self._answers.must_wait():
            return
        if len(self._images):
            if self._images.next.begins_anew:
                self._health.restarts += 1
                self.log.warning(f"camera {self.camera}: the time of its images goes back; it begins anew")
                self._begin()
            came_s = self._images.next.item.seconds
            # While the registration does not answer images wait for it to start, and not because the machine is slow.
            image = self._images.take(self._answers.since_s or time.monotonic())
            if image is not None:
                self._track(self._tracker, image, came_s)
            # One image at a time, so that landmarks are heard in between however many images wait.
            self.soon(self._track_next)

    def _track(self, tracker: LandmarkTracker, image: CameraImage, came_s: float) -> None:
        self.moments.note(Moment.TRACKING, self.camera, image.stamp_ns)
        try:
            grey = decode_grey(image)
            frame = tracker.track(grey, image.stamp_ns)
        except RecordingError as error:
            self.skipped.add("images skipped", str(error))
            return
        self._tracks.publish(tracks_message(self.make, frame))
        self.moments.note(Moment.TRACKED, self.camera, frame.stamp_ns)
        self._answers.sent(frame.stamp_ns)
        tally = self._health.tally
        tally.images, tally.latency_s = tally.images + 1, tally.latency_s + time.monotonic() - came_s
        tally.tracks, tally.keyframes = tally.tracks + len(frame.track_ids), tally.keyframes + frame.keyframe
        # Not while others wait: to keep up comes first.
        if self._lens is not None and not len(self._images) and self._lens.add_image(grey) and self._lens.remark:
            self.log.warning(self._lens.remark)

    def _on_landmarks(self, message: Message) -> None:
        if self._tracker is None:
            return
        try:
            matches = landmark_matches(message, self.camera)
        except ValueError as error:
            self.skipped.add("landmarks skipped", f"{self.camera}/landmarks: malformed message ({error})")
            return
        # What was said of the tracks of a tracker before this one, or of a time before, does not concern these.
        if self._answers.answered(matches.stamp_ns):
            self._tracker.add_registration(matches)
            if self._lens is not None:
                self._lens.add_registration(matches.world_T_camera is not None)
        self.soon(self._track_next)

    def _on_request(self, message: Message) -> None:
        if self._tracker is not None:
            self._tracker.want_keyframe()

    def health(self) -> list[Health]:
        """How the images of the last second fared."""
        lens = (self._lens.state, self._lens.remark) if self._lens is not None else ("unknown", "")
        source, has_info = self._source, self._tracker is not None
        return [
            self._health.of_tracker(
                source.quiet_s, source.what_is_wrong(), self._what_is_lacking(), has_info, lens, self._models.changes
            )
        ]


make = partial(StageNode, TrackerStage)
"""Makes the node."""
