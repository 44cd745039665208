"""Node ``tracker``: the images of one camera in, feature tracks out (A 4.1, the first half)."""

import time
from functools import partial
from pathlib import Path

from bodycam_ros.camera.camera_image import CameraImage, decode_grey
from bodycam_ros.camera_pipeline import landmark_tracker
from bodycam_ros.errors import RecordingError
from bodycam_ros.lens.lens_check import LensMonitor
from bodycam_ros.live.node_parameters import TRACKER_GROUPS, TrackerParameters
from bodycam_ros.messages.diagnostics import Status
from bodycam_ros.messages.factory import Message
from bodycam_ros.messages.tracks import LANDMARKS_TYPE, TRACKS_TYPE, landmark_matches, tracks_message
from bodycam_ros.moments import Moment
from bodycam_ros.nodes.camera_topics import CameraModels
from bodycam_ros.nodes.image_stage import ImageStage
from bodycam_ros.nodes.parameters import STAGE_DEPTH, reliable
from bodycam_ros.nodes.stage_node import StageNode
from bodycam_ros.registration.landmark_tracker import LandmarkTracker
from bodycam_ros.registration.reference_map import load_map


class TrackerStage(ImageStage[TrackerParameters]):
    """Tracks the features of one camera.

    Images wait until there is a camera_info and a reader of the tracks: a lost track message is lost for good. Tracking
    restarts when the camera_info changes, and after the node was inactive.
    """

    name, parameters_type, groups = "tracker", TrackerParameters, TRACKER_GROUPS

    def __init__(self, node: StageNode[TrackerParameters]) -> None:
        super().__init__(node)
        self._map = load_map(Path(self.parameters.map)) if self.parameters.map else None
        self._tracker: LandmarkTracker | None = None
        self._lens: LensMonitor | None = None
        self._readers = 0
        self._tracks = self.publisher(TRACKS_TYPE, f"{self.camera}/tracks", reliable(STAGE_DEPTH))
        self.subscription(LANDMARKS_TYPE, f"{self.camera}/landmarks", self._add_landmarks, reliable(STAGE_DEPTH))
        self.subscription("std_msgs/msg/Empty", f"{self.camera}/want_keyframe", self._request_keyframe, reliable(1))
        self.subscribe_images()
        # Last: a node that is seen to read camera_info reads the rest too.
        self._models = CameraModels(self, [self.camera], self._set_model, fatal=True)
        self.trigger("~/reset", self._reset)

    def pause(self) -> None:
        """Drop the images; the first one afterwards has no predecessor."""
        self.images.clear()
        if self._tracker is not None:
            self.restart()

    def restart(self) -> None:
        """Forget all images so far; the next is a keyframe without a predecessor."""
        self._tracker = landmark_tracker(self._models.models[self.camera], self._map, self.settings)
        self.unanswered.clear()
        self.images.thinning.forget()

    def is_ready(self) -> bool:
        """Whether there is a model, a reader, and not too many frames without an answer."""
        return self._tracker is not None and self._has_reader() and not self.unanswered.must_wait()

    def waiting_reason(self) -> str:
        """Reason why the next image has to wait."""
        if self._tracker is None:
            return f"there is no {self.camera}/camera_info"
        return "" if self._has_reader() else f"no node reads {self.camera}/tracks"

    def processing_since_s(self) -> float:
        """Images that wait for the start of the registration do not count as waiting for a slow machine."""
        return self.unanswered.answered_since_s or time.monotonic()

    def process(self, image: CameraImage, arrival_s: float) -> None:
        """Track an image."""
        assert self._tracker is not None
        self.moments.note(Moment.TRACKING, self.camera, image.stamp_ns)
        try:
            grey = decode_grey(image)
            frame = self._tracker.track(grey, image.stamp_ns)
        except RecordingError as error:
            self.dropped.add("images unusable", str(error))
            return
        self._tracks.publish(tracks_message(self.make, frame))
        self.moments.note(Moment.TRACKED, self.camera, frame.stamp_ns)
        self.unanswered.add(frame.stamp_ns)
        tally = self.diagnostics.tally
        tally.add_image(arrival_s)
        tally.tracks, tally.keyframes = tally.tracks + len(frame.track_ids), tally.keyframes + frame.keyframe
        # The lens is checked only while no image waits.
        if self._lens is not None and not len(self.images) and self._lens.add_image(grey) and self._lens.remark:
            self.log.warning(self._lens.remark)

    def _reset(self) -> tuple[bool, str]:
        if self._tracker is None:
            return True, f"nothing to reset: there is no {self.camera}/camera_info"
        self.diagnostics.restarts += 1
        self.restart()
        return True, f"camera {self.camera} restarts: the next image is a keyframe without a predecessor"

    def _set_model(self, camera: str) -> None:
        self._lens = LensMonitor(self._models.models[camera])
        self.restart()
        self.call_later(self.process_next)

    def _has_reader(self) -> bool:
        readers = self._tracks.get_subscription_count()
        if readers > self._readers:
            # It may replace a registration that was killed and answers nothing any more.
            self.unanswered.expect_no_answer()
        self._readers = readers
        return bool(readers)

    def _add_landmarks(self, message: Message) -> None:
        if self._tracker is None:
            return
        try:
            matches = landmark_matches(message, self.camera)
        except ValueError as error:
            self.dropped.add("landmarks dropped", f"{self.camera}/landmarks: malformed message ({error})")
            return
        # Answers to frames before a restart do not concern the current tracks.
        if self.unanswered.answer(matches.stamp_ns):
            self._tracker.add_registration(matches)
            if self._lens is not None:
                self._lens.add_registration(matches.world_T_camera is not None)
        self.call_later(self.process_next)

    def _request_keyframe(self, message: Message) -> None:
        if self._tracker is not None:
            self._tracker.want_keyframe()

    def report(self) -> list[Status]:
        """Status of the camera since the last report."""
        lens = (self._lens.state, self._lens.remark) if self._lens is not None else ("unknown", "")
        missing = self.missing_input(self.waiting_reason() or "images arrive faster than they are processed")
        return [self.diagnostics.report_tracker(missing, self._tracker is not None, lens, self._models.changes)]


make = partial(StageNode, TrackerStage)
"""Constructor of the node."""
