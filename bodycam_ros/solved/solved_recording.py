"""What a replay or a live run published, as arrays: read from its bag, or from one recorded from the live graph."""

import math
from collections import defaultdict
from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.urdf import optical_frame
from bodycam_ros.equipment.equipment_record import EquipmentLog, EquipmentRecord
from bodycam_ros.errors import RecordingError
from bodycam_ros.geometry import Array
from bodycam_ros.messages.clocks import TIMING, TIMING_TYPE, clock_state, says_clock
from bodycam_ros.messages.equipment import EQUIPMENT, EQUIPMENT_TYPE, equipment_report
from bodycam_ros.messages.factory import Message
from bodycam_ros.messages.header import stamp_ns
from bodycam_ros.messages.tracks import landmark_matches, track_frame
from bodycam_ros.recording.bag_file import BagFile
from bodycam_ros.registration.camera_sight import CameraSight, camera_sight
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.solved.body_motion import BodyMotion, MotionJoiner
from bodycam_ros.solved.image_motion import ImageMotion
from bodycam_ros.solved.topics import (
    LANDMARKS,
    LANDMARKS_TYPE,
    MOTION_TOPICS,
    ROBOT,
    ROBOT_TYPE,
    camera_topics,
    contradictions_named,
    published_robot,
    read_landmarks,
)
from bodycam_ros.solved.trajectory import between_neighbours
from bodycam_ros.solved.urdf_tree import UrdfTree
from bodycam_ros.timing.clock_history import ClockHistory
from bodycam_ros.timing.clock_state import ClockState

GAP_FRAMES = 1.5
"""Instants further apart than this are a gap [frames]; between others the body is known."""

_LEFT_OUT_NOWHERE = 10
"""Percentile of the steps between instants: of ten neighbours, two at least are neighbours indeed."""

_TRACKS, _TRACKS_TYPE = "/tracks", "bodycam_msgs/msg/FeatureTracks"
_BODY_TOPICS = {ROBOT: ROBOT_TYPE, **MOTION_TOPICS}


@dataclass(frozen=True, eq=False)
class CameraRecord:
    """One camera over K images.

    Attributes:
        camera: name.
        stamps_ns: (K,) of its images, corrected by what is known of its clock, increasing [ns].
        tracks: (K,) feature tracks; -1 where the bag does not say.
        landmarks: (K,) tracks that are named, which means that they carry a landmark of the map.
        world_T_camera: (K, 4, 4) registered pose of the optical frame [m]; NaN while the camera is lost.
        image_motion: (K,) by how much the picture moved since the image before, the median over tracks [px]; NaN where
            none was followed.
        sights: (K,) what it knew, a ``CameraSight`` each.
        timing: its clock; None where the bag does not say.
    """

    camera: str
    stamps_ns: NDArray[np.int64]
    tracks: NDArray[np.int64]
    landmarks: NDArray[np.int64]
    world_T_camera: Array
    image_motion: Array
    sights: NDArray[np.int8]
    timing: ClockHistory | None = None

    def time_of(self, stamps_ns: NDArray[np.int64]) -> NDArray[np.int64]:
        """Stamps (N,) of images as the camera gave them, as times of the recording [ns]."""
        return stamps_ns if self.timing is None else self.timing.corrected_ns(stamps_ns)

    @property
    def registered(self) -> NDArray[np.bool_]:
        """(K,) whether the camera knew its pose."""
        known: NDArray[np.bool_] = np.isfinite(self.world_T_camera[:, 0, 0])
        return known


@dataclass(frozen=True, eq=False)
class SolvedRecording:
    """The body over T instants, and the cameras that it was solved from.

    Attributes:
        path: of the bag.
        urdf: the robot that ``/robot_description`` describes.
        motion: of the body.
        cameras: in the order of the URDF.
        equipment: how the body was coupled to it; None without.
    """

    path: Path
    urdf: UrdfTree
    motion: BodyMotion
    cameras: tuple[CameraRecord, ...]
    equipment: EquipmentRecord | None = None

    @property
    def stamps_ns(self) -> NDArray[np.int64]:
        """(T,) solved instants, increasing [ns]."""
        return self.motion.stamps_ns

    @cached_property
    def world_T_link(self) -> dict[str, Array]:
        """Link -> poses (T, 4, 4) in the world [m], by the URDF's forward kinematics."""
        angles = dict(zip(self.motion.joint_names, self.motion.joint_angles.T, strict=True))
        return self.urdf.forward_kinematics(self.motion.world_T_root, angles)

    @cached_property
    def placed(self) -> NDArray[np.bool_]:
        """(T,) whether it is known where the equipment is; of a recording that does not tell, always."""
        if self.equipment is None:
            return np.ones(len(self.stamps_ns), bool)
        return np.isin(self.stamps_ns, self.equipment.stamps_ns[self.equipment.placed])

    @cached_property
    def start_ns(self) -> int:
        """The first image or instant [ns]."""
        return int(min([self.stamps_ns[0], *(record.stamps_ns[0] for record in self.cameras)]))

    @cached_property
    def end_ns(self) -> int:
        """The last image or instant [ns]."""
        return int(max([self.stamps_ns[-1], *(record.stamps_ns[-1] for record in self.cameras)]))

    @cached_property
    def frame_ns(self) -> int:
        """Time between two images of a camera, the median over all [ns]; of instants if there are too few images."""
        steps = [np.diff(record.stamps_ns) for record in self.cameras]
        steps = steps if any(len(step) for step in steps) else [np.diff(self.stamps_ns)]
        together = np.concatenate(steps)
        return int(np.median(together)) if len(together) else 1

    @cached_property
    def instant_ns(self) -> int:
        """Time between two instants where none is left out [ns]: a frame, unless another rate was asked for."""
        steps = np.diff(self.stamps_ns)
        return int(np.percentile(steps, _LEFT_OUT_NOWHERE)) if len(steps) else self.frame_ns

    @cached_property
    def longest_step_ns(self) -> float:
        """Instants that are further apart have a gap between them [ns]."""
        return GAP_FRAMES * max(self.frame_ns, self.instant_ns)

    def landmarks(self, cameras: Collection[str]) -> Iterator[LandmarkMatches]:
        """The registrations of some cameras, in the order of the bag, at times of the recording.

        Raises:
            RecordingError: the bag or a message is damaged.
        """
        records = {record.camera: record for record in self.cameras}
        for matches in read_landmarks(self.path, cameras):
            record = records.get(matches.camera)
            if record is None or record.timing is None:
                yield matches
            else:
                yield replace(matches, stamp_ns=int(record.time_of(np.array([matches.stamp_ns]))[0]))

    def seconds(self, stamps_ns: NDArray[np.int64]) -> Array:
        """Stamps [ns] as times since the start of the recording [s]."""
        return np.asarray((stamps_ns - self.start_ns) * 1e-9, dtype=np.float64)

    def is_solved_at(self, stamps_ns: NDArray[np.int64]) -> NDArray[np.bool_]:
        """(N,) whether stamps (N,) [ns] lie between instants, without a gap."""
        return between_neighbours(self.stamps_ns, stamps_ns, self.longest_step_ns)

    def solved_cameras(self) -> Iterator[tuple[CameraRecord, Array]]:
        """Each camera that the URDF mounts, with its solved poses world_T_camera (T, 4, 4) [m]."""
        for record in self.cameras:
            link = optical_frame(record.camera)
            if link in self.world_T_link:
                yield record, self.world_T_link[link]


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
        of_cameras = {
            topic: camera
            for suffix, kind in ((LANDMARKS, LANDMARKS_TYPE), (_TRACKS, _TRACKS_TYPE), (TIMING, TIMING_TYPE))
            for topic, camera in camera_topics(bag, suffix, kind).items()
        }
        coupled = EquipmentLog()
        equipment = [EQUIPMENT] if bag.topics.get(EQUIPMENT) == EQUIPMENT_TYPE else []
        for topic, _, message in bag.messages([*MOTION_TOPICS, *equipment, *of_cameras]):
            if topic in MOTION_TOPICS:
                body.add(topic, message)
                continue
            if topic in equipment:
                with contradictions_named(path, topic):
                    coupled.add(stamp_ns(message.header.stamp), equipment_report(message))
                continue
            with contradictions_named(path, topic):
                cameras[of_cameras[topic]].add(topic, message, of_cameras[topic])
    order = {camera: place for place, camera in enumerate(urdf.cameras)}
    records = [messages.record(camera) for camera, messages in cameras.items() if messages.landmarks]
    if not records:
        raise RecordingError(
            f"{path}: no message on /<camera>{LANDMARKS} can be read; another version of bodycam wrote this bag: "
            "replay the recording again"
        )
    records.sort(key=lambda record: (order.get(record.camera, len(order)), record.camera))
    return SolvedRecording(path, urdf, body.joined(), tuple(records), coupled.record())


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
        self.landmarks: dict[int, tuple[int, Array | None, CameraSight]] = {}
        self._tracks: dict[int, tuple[int, float]] = {}
        self._motion = ImageMotion()
        self._clocks: dict[int, ClockState] = {}
        self._readout = (math.nan, math.nan)

    def add(self, topic: str, message: Message, camera: str) -> None:
        if topic.endswith(_TRACKS):
            frame = track_frame(message, camera)
            self._tracks[frame.stamp_ns] = (len(frame.track_ids), self._motion.add(frame.track_ids, frame.pixels))
            return
        if topic.endswith(TIMING):
            if says_clock(message):
                clock = clock_state(message)
                self._clocks[clock.since_ns] = clock
            if not math.isnan(message.readout_sigma):
                self._readout = message.readout_time, message.readout_sigma
            return
        matches = landmark_matches(message, camera)
        self.landmarks[matches.stamp_ns] = (
            len(matches.landmark_ids),
            matches.world_T_camera,
            camera_sight(matches),
        )

    def record(self, camera: str) -> CameraRecord:
        stamps = sorted(self.landmarks)
        lost = np.full((4, 4), np.nan)
        poses = [self.landmarks[stamp][1] for stamp in stamps]
        tracks = [self._tracks.get(stamp, (-1, np.nan)) for stamp in stamps]
        clocks = tuple(self._clocks[since] for since in sorted(self._clocks))
        timing = ClockHistory(camera, clocks, *self._readout) if clocks else None
        given_ns = np.array(stamps, dtype=np.int64)
        return CameraRecord(
            camera=camera,
            stamps_ns=given_ns if timing is None else timing.corrected_ns(given_ns),
            tracks=np.array([count for count, _ in tracks], dtype=np.int64),
            landmarks=np.array([self.landmarks[stamp][0] for stamp in stamps], dtype=np.int64),
            world_T_camera=np.array([lost if pose is None else pose for pose in poses]),
            image_motion=np.array([moved for _, moved in tracks], dtype=np.float64),
            sights=np.array([self.landmarks[stamp][2] for stamp in stamps], dtype=np.int8),
            timing=timing,
        )
