"""Reads the bag that ``bodycam replay`` writes, or one recorded from the live graph."""

from collections import defaultdict
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.errors import RecordingError
from bodycam_ros.evaluate.solved_recording import CameraRecord, SolvedRecording
from bodycam_ros.evaluate.urdf_tree import UrdfTree
from bodycam_ros.geometry import Array
from bodycam_ros.messages.factory import Message, numbers
from bodycam_ros.messages.header import stamp_ns
from bodycam_ros.messages.pose import pose_and_covariance
from bodycam_ros.messages.tracks import landmark_matches
from bodycam_ros.recording.bag_file import BagFile

LANDMARKS, LANDMARKS_TYPE = "/landmarks", "bodycam_msgs/msg/LandmarkMatches"
"""End and type of a camera's topic of registrations."""

_TRACKS, _TRACKS_TYPE = "/tracks", "bodycam_msgs/msg/FeatureTracks"
_BODY_TOPICS = {
    "/robot_description": "std_msgs/msg/String",
    "/joint_states": "sensor_msgs/msg/JointState",
    "/odometry": "nav_msgs/msg/Odometry",
}


def read_solved(path: Path) -> SolvedRecording:
    """Read what was solved.

    Args:
        path: ros2 bag folder or .mcap file.

    Raises:
        RecordingError: not a bag, a topic of the contract is missing or empty, or the topics do not fit each other.
    """
    with BagFile(path) as bag:
        _check_topics(bag)
        urdf = _urdf(bag)
        body = _BodyMessages(path, urdf)
        cameras: dict[str, _CameraMessages] = defaultdict(_CameraMessages)
        of_cameras = camera_topics(bag, LANDMARKS, LANDMARKS_TYPE) | camera_topics(bag, _TRACKS, _TRACKS_TYPE)
        for topic, _, message in bag.messages(["/joint_states", "/odometry", *of_cameras]):
            try:
                if topic in of_cameras:
                    cameras[of_cameras[topic]].add(topic, message, of_cameras[topic])
                else:
                    body.add(topic, message)
            except ValueError as error:
                raise RecordingError(f"{path}: a message on {topic} contradicts itself: {error}") from error
    order = {camera: place for place, camera in enumerate(urdf.cameras)}
    records = [messages.record(camera) for camera, messages in cameras.items() if messages.landmarks]
    records.sort(key=lambda record: (order.get(record.camera, len(order)), record.camera))
    return body.solved(tuple(records))


def camera_topics(bag: BagFile, suffix: str, message_type: str) -> dict[str, str]:
    """Topic -> camera, of the topics ``/<camera><suffix>`` of a type."""
    found = {}
    for topic, kind in bag.topics.items():
        camera = topic.removeprefix("/").removesuffix(suffix)
        if topic.endswith(suffix) and kind == message_type and camera:
            found[topic] = camera
    return found


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


def _urdf(bag: BagFile) -> UrdfTree:
    text = ""
    for _, _, message in bag.messages(["/robot_description"]):
        text = message.data
    return UrdfTree.parse(text, f"{bag.path}: /robot_description")


class _BodyMessages:
    """Joint states and odometry, to be joined by their stamps."""

    def __init__(self, path: Path, urdf: UrdfTree) -> None:
        self._path = path
        self._urdf = urdf
        self._names = urdf.moving
        self._angles: dict[int, NDArray[np.float64]] = {}
        self._root: dict[int, tuple[Array, Array]] = {}

    def add(self, topic: str, message: Message) -> None:
        stamp = stamp_ns(message.header.stamp)
        if topic == "/odometry":
            self._root[stamp] = pose_and_covariance(message.pose)
            return
        if missing := [name for name in self._names if name not in message.name]:
            raise RecordingError(
                f"{self._path}: /joint_states lacks {', '.join(missing)}, which /robot_description has; are both of "
                "the same body?"
            )
        column = {name: column for column, name in enumerate(message.name)}
        angles = numbers(message.position, np.float64, len(message.name))
        self._angles[stamp] = angles[[column[name] for name in self._names]]

    def solved(self, cameras: tuple[CameraRecord, ...]) -> SolvedRecording:
        stamps = sorted(stamp for stamp in self._angles if stamp in self._root and self._is_finite(stamp))
        if not stamps:
            raise RecordingError(
                f"{self._path}: none of {len(self._angles)} /joint_states has an /odometry of the same stamp and "
                "finite values; were both recorded, and by one solver?"
            )
        return SolvedRecording(
            path=self._path,
            urdf=self._urdf,
            stamps_ns=np.array(stamps, dtype=np.int64),
            joint_names=self._names,
            joint_angles=np.array([self._angles[stamp] for stamp in stamps]),
            world_T_root=np.array([self._root[stamp][0] for stamp in stamps]),
            root_covariance=np.array([self._root[stamp][1] for stamp in stamps]),
            cameras=cameras,
        )

    def _is_finite(self, stamp: int) -> bool:
        return bool(np.isfinite(self._angles[stamp]).all() and np.isfinite(self._root[stamp][0]).all())


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
