"""Node ``tracker``: the images of one camera in, feature tracks out (A 4.1, the first half)."""

import re
import time
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

from bodycam_ros.body.body_file import read_body
from bodycam_ros.camera.camera_image import CameraImage, check_image_size, decode_grey
from bodycam_ros.graph.node_parameters import TRACKER_GROUPS, TrackerParameters
from bodycam_ros.graph.unanswered_frames import UnansweredFrames
from bodycam_ros.inertial.camera_turn import CameraTurn
from bodycam_ros.inertial.imu_calibration import ImuCalibration
from bodycam_ros.messages.diagnostics import Status, StatusLevel
from bodycam_ros.messages.factory import Message
from bodycam_ros.messages.tracks import LANDMARKS_TYPE, TRACKS_TYPE, landmark_matches, tracks_message
from bodycam_ros.nodes.camera_images import CameraImages
from bodycam_ros.nodes.camera_topics import CameraModels, subscribe_sensor
from bodycam_ros.nodes.moments import Moment
from bodycam_ros.nodes.parameters import STAGE_DEPTH, reliable
from bodycam_ros.nodes.stage_node import Stage, StageNode
from bodycam_ros.pipeline.camera_front import CameraFront
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.registration.map_identity import MapIdentity, map_identity
from bodycam_ros.registration.reference_map import load_map

_NO_NAME = re.compile(r"\W", re.ASCII)
"""What a camera's name, a part of topics, may have and a node's may not."""


class TrackerStage(Stage[TrackerParameters]):
    """Tracks the features of one camera.

    Images wait until there is a camera_info and a reader of the tracks, for a lost track message is lost for good, and
    while ``most_ahead`` frames are unanswered. Tracking restarts when the time of the images jumps, when the
    camera_info changes, and after the node was inactive.
    """

    name = "tracker"
    parameters_type = TrackerParameters
    groups = TRACKER_GROUPS

    def __init__(self, node: StageNode[TrackerParameters]) -> None:
        super().__init__(node)
        self.camera = self.required("camera")
        self._map = load_map(Path(self.parameters.map)) if self.parameters.map else None
        self._identity = MapIdentity("") if self._map is None else map_identity(self._map)
        self._map_error = ""
        self._front: CameraFront | None = None
        self._readers = self._track_count = self._keyframes = 0
        self.unanswered = UnansweredFrames()
        self._tracks = self.publisher(TRACKS_TYPE, f"{self.camera}/tracks", reliable(STAGE_DEPTH))
        answer = LANDMARKS_TYPE, f"{self.camera}/landmarks", self._add_landmarks, reliable(STAGE_DEPTH)
        self.subscription(*answer, partial(landmark_matches, camera=self.camera), "landmarks dropped")
        self.subscription("std_msgs/msg/Empty", f"{self.camera}/want_keyframe", self._request_keyframe, reliable(1))
        self._turn: CameraTurn | None = None
        self._sensor = self._read_sensor()
        if self._sensor is not None:
            subscribe_sensor(self, self.camera, self._add_sample)
        self._images = CameraImages(
            self, self.camera, self.dropped, self._track, self._waiting_reason, self._forget, self._ready_since_s
        )
        # Last: a node whose subscription to camera_info is discovered reads the rest too.
        self._models = CameraModels(self, [self.camera], self._set_model)
        self.trigger("~/reset", self._reset)

    @classmethod
    def node_name(cls, words: Sequence[str]) -> str:
        """``tracker_<camera>``: trackers that are started by hand have different names, too."""
        named = [word.partition(":=")[2].strip("'\"") for word in words if word.startswith("camera:=")]
        return "_".join([cls.name, *(_NO_NAME.sub("_", camera) for camera in named[-1:])])

    def pause(self) -> None:
        """Drop the images; the first one afterwards has no predecessor."""
        self._images.drop()
        self._forget()

    def _forget(self) -> None:
        """Forget all images so far; the next is a keyframe without a predecessor."""
        if self.camera in self._models.models:
            # Samples from before a restart would do, but not those from before the time of the images went back.
            self._turn = CameraTurn(self._sensor) if self._sensor is not None else None
            model = self._models.models[self.camera]
            self._front = CameraFront(model, self._map, self.settings, turn=self._turn)
        self.unanswered.clear()

    def _waiting_reason(self) -> str:
        """Reason why the next image has to wait."""
        if reason := self._models.rejected.get(self.camera):
            return f"its camera_info is unusable: {reason}"
        if self._front is None:
            return f"there is no {self.camera}/camera_info"
        if not self._has_reader():
            return f"no node reads {self.camera}/tracks"
        return "the registration has not answered yet" if self.unanswered.must_wait(self.parameters.most_ahead) else ""

    def _ready_since_s(self) -> float:
        """Images that wait for the start of the registration do not count as waiting for a slow machine."""
        return self.unanswered.answered_since_s or time.monotonic()

    def _track(self, image: CameraImage) -> bool:
        """Track an image; raises RecordingError if it cannot be used."""
        assert self._front is not None
        self.moments.note(Moment.TRACKING, self.camera, image.stamp_ns)
        check_image_size(image, self._models.models[self.camera])
        frame = self._front.track(decode_grey(image), image.stamp_ns)
        self._tracks.publish(tracks_message(self.make, replace(frame, map_identity=str(self._identity))))
        self.moments.note(Moment.TRACKED, self.camera, frame.stamp_ns)
        self.unanswered.add(frame.stamp_ns)
        self._track_count += len(frame.track_ids)
        self._keyframes += frame.keyframe
        return True

    def _reset(self) -> str:
        if self._front is None:
            return f"nothing to reset: there is no {self.camera}/camera_info"
        self._images.restart()
        return f"camera {self.camera} restarts: the next image is a keyframe without a predecessor"

    def _set_model(self, camera: str) -> None:
        self._forget()
        self.call_later(self._images.process_next)

    def _has_reader(self) -> bool:
        readers = self._tracks.get_subscription_count()
        if readers > self._readers:
            # It may replace a registration that was killed and answers nothing any more.
            self.unanswered.expect_no_answer()
        self._readers = readers
        return bool(readers)

    def _add_landmarks(self, matches: LandmarkMatches) -> None:
        if self._front is None:
            return
        # Answers to frames before a restart do not concern the current tracks.
        if self.unanswered.answer(matches.stamp_ns) and self._is_in_map(MapIdentity.parse(matches.map_identity)):
            self._front.accept(matches)
        self.call_later(self._images.process_next)

    def _is_in_map(self, other: MapIdentity) -> bool:
        """Whether the registration uses the tracker's map, or nothing says otherwise.

        The registration logs it, of all cameras in one line; here it is in the diagnostics.
        """
        self._map_error = ""
        if self._identity.contradicts(other):
            self._map_error = (
                f"this tracker uses map {self.parameters.map} ({self._identity}), the registration map {other}: its "
                "landmarks are refused; start both with the same map:=MAP"
            )
        return not self._map_error

    def _read_sensor(self) -> ImuCalibration | None:
        """Calibration of the camera's inertial sensor; None if the body has none."""
        if not (self.parameters.body and self.settings.inertial.enabled):
            return None
        mount = read_body(self.parameters.body).mounts.get(self.camera)
        return None if mount is None else mount.imu

    def _add_sample(self, stamp_ns: int, reading: tuple[float, ...]) -> None:
        if self._turn is not None:
            self._turn.motion.add_sample(stamp_ns, reading)

    def _request_keyframe(self, message: Message) -> None:
        if self._front is not None:
            self._front.want_keyframe()

    @property
    def _sensor_state(self) -> str:
        turn = self._turn
        if turn is None:
            return "none"
        return "in use" if turn.is_confirmed else "contradicts the images" if turn.is_wrong else "not in use"

    def report(self) -> list[Status]:
        """Status of the camera since the last report."""
        values: dict[str, object] = {
            "tracks per image": self._images.tally.mean(self._track_count),
            "keyframes": self._keyframes,
            "camera_info changed": self._models.changes,
            "inertial sensor": self._sensor_state,
            "map": f"{self.parameters.map} ({self._identity})" if self._map is not None else "none",
        }
        error = (
            ""
            if self._track_count
            else "the images show nothing that can be tracked; check that the lens is not covered"
        )
        self._track_count = self._keyframes = 0
        status = self._images.status(values, self._map_error or error)
        if reason := self._models.rejected.get(self.camera):
            status = replace(status, level=StatusLevel.ERROR, text=f"its camera_info is unusable: {reason}")
        return [status]


make = partial(StageNode, TrackerStage)
"""Constructor of the node."""
