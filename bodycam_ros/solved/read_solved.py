"""Reads the bag that ``bodycam replay`` writes, or one recorded from the live graph."""

from collections import defaultdict
from pathlib import Path

import numpy as np

from bodycam_ros.errors import RecordingError
from bodycam_ros.geometry import Array
from bodycam_ros.messages.factory import Message
from bodycam_ros.messages.header import stamp_ns
from bodycam_ros.messages.tracks import landmark_matches
from bodycam_ros.recording.bag_file import BagFile
from bodycam_ros.solved.body_motion import MotionJoiner
from bodycam_ros.solved.solved_recording import CameraRecord, SolvedRecording
from bodycam_ros.solved.topics import (
    LANDMARKS,
    LANDMARKS_TYPE,
    MOTION_TOPICS,
    ROBOT,
    ROBOT_TYPE,
    camera_topics,
    contradictions_named,
    published_robot,
)
from bodycam_ros.solved.urdf_tree import UrdfTree

_TRACKS, _TRACKS_TYPE = "/tracks", "bodycam_msgs/msg/FeatureTracks"
_BODY_TOPICS = {ROBOT: ROBOT_TYPE, **MOTION_TOPICS}


def read_solved(path: Path) -> SolvedRecording:
    """Read what was solved.

    Args:
        path: ros2 bag folder or .mcap file.

    Raises:
        RecordingError: not a bag, a topic of the contract is missing or empty, or the topics do not fit each other.
    """
    with BagFile(path) as bag:
        _check_topics(bag)
        urdf = UrdfTree.parse(published_robot(bag), f"{path}: {ROBOT}")
        body = MotionJoiner(path, urdf.moving, ROBOT)
        cameras: dict[str, _CameraMessages] = defaultdict(_CameraMessages)
        of_cameras = camera_topics(bag, LANDMARKS, LANDMARKS_TYPE) | camera_topics(bag, _TRACKS, _TRACKS_TYPE)
        for topic, _, message in bag.messages([*MOTION_TOPICS, *of_cameras]):
            if topic in MOTION_TOPICS:
                body.add(topic, message)
                continue
            with contradictions_named(path, topic):
                cameras[of_cameras[topic]].add(topic, message, of_cameras[topic])
    order = {camera: place for place, camera in enumerate(urdf.cameras)}
    records = [messages.record(camera) for camera, messages in cameras.items() if messages.landmarks]
    records.sort(key=lambda record: (order.get(record.camera, len(order)), record.camera))
    return SolvedRecording(path, urdf, body.joined(), tuple(records))


def _check_topics(bag: BagFile) -> None:
    for topic, wanted in _BODY_TOPICS.items():
        kind = bag.topics.get(topic)
        if kind is not None and kind != wanted:
            raise RecordingError(f"{bag.path}: {topic} is {kind}, expected {wanted}")
        if kind is None or bag.message_count(topic) == 0:
            _refuse(bag, f"{'no topic' if kind is None else 'no message on'} {topic}")
    if not any(bag.message_count(topic) for topic in camera_topics(bag, LANDMARKS, LANDMARKS_TYPE)):
        _refuse(bag, f"no topic /<camera>{LANDMARKS} ({LANDMARKS_TYPE}) with messages")


def _refuse(bag: BagFile, what: str) -> None:
    raise RecordingError(
        f"{bag.path}: {what}; expected a bag that 'bodycam replay' wrote, or a recording of all topics of the live "
        f"graph; there are: {', '.join(bag.topics) or 'none at all'}"
    )


class _CameraMessages:
    """Registrations and tracks of one camera, to be joined by their stamps."""

    def __init__(self) -> None:
        self.landmarks: dict[int, tuple[int, Array | None]] = {}
        self._tracks: dict[int, int] = {}

    def add(self, topic: str, message: Message, camera: str) -> None:
        if topic.endswith(_TRACKS):
            self._tracks[stamp_ns(message.header.stamp)] = len(message.track_ids)
            return
        matches = landmark_matches(message, camera)
        self.landmarks[matches.stamp_ns] = (len(matches.landmark_ids), matches.world_T_camera)

    def record(self, camera: str) -> CameraRecord:
        stamps = sorted(self.landmarks)
        lost = np.full((4, 4), np.nan)
        poses = [self.landmarks[stamp][1] for stamp in stamps]
        return CameraRecord(
            camera=camera,
            stamps_ns=np.array(stamps, dtype=np.int64),
            tracks=np.array([self._tracks.get(stamp, -1) for stamp in stamps], dtype=np.int64),
            landmarks=np.array([self.landmarks[stamp][0] for stamp in stamps], dtype=np.int64),
            world_T_camera=np.array([lost if pose is None else pose for pose in poses]),
        )
