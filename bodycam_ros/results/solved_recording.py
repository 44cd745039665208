"""What a replay or a live run published, as arrays: read from its bag, or from one recorded from the live graph."""

from collections import defaultdict
from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.equipment_report import EquipmentLog, EquipmentRecord
from bodycam_ros.body.urdf import optical_frame
from bodycam_ros.errors import RecordingError
from bodycam_ros.geometry import Array
from bodycam_ros.messages.equipment import EQUIPMENT, EQUIPMENT_TYPE, equipment_report
from bodycam_ros.messages.factory import stamp_ns
from bodycam_ros.messages.segment_poses import SEGMENT_POSES, SEGMENT_POSES_TYPE
from bodycam_ros.messages.timing import TIMING, TIMING_TYPE
from bodycam_ros.recording.bag_file import BagFile
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.results.body_motion import BodyMotion, MotionJoiner, between_neighbours
from bodycam_ros.results.camera_record import TRACKS, TRACKS_TYPE, CameraLog, CameraRecord, StationLog, StationRecord
from bodycam_ros.results.topics import (
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
from bodycam_ros.results.urdf_tree import UrdfTree
from bodycam_ros.verdict import VERDICT, VERDICT_TYPE, Verdict, parse_verdict

GAP_FRAMES = 1.5
"""Instants further apart than this are a gap [frames]; between others the body is known."""

_LEFT_OUT_NOWHERE = 10
"""Percentile of the steps between instants: of ten neighbours, two at least are neighbours indeed."""

_BODY_TOPICS = {ROBOT: ROBOT_TYPE, **MOTION_TOPICS}


@dataclass(frozen=True, eq=False)
class SolvedRecording:
    """The body over T instants, and the cameras that it was solved from.

    Attributes:
        path: of the bag.
        urdf: the robot that ``/robot_description`` describes.
        motion: of the body.
        cameras: worn ones, in the order of the URDF.
        equipment: how the body was coupled to it; None without.
        stations: static cameras; without any there are worn ones.
        stored_verdict: of the replay; None in a bag of the live graph or of an older version.
    """

    path: Path
    urdf: UrdfTree
    motion: BodyMotion
    cameras: tuple[CameraRecord, ...]
    equipment: EquipmentRecord | None = None
    stations: tuple[StationRecord, ...] = ()
    stored_verdict: Verdict | None = None

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

    @property
    def image_stamps_ns(self) -> list[NDArray[np.int64]]:
        """(K,) stamps of the images of each camera, worn or static [ns]."""
        return [*(record.stamps_ns for record in self.cameras), *(record.stamps_ns for record in self.stations)]

    @cached_property
    def start_ns(self) -> int:
        """The first image or instant [ns]."""
        return int(min([self.stamps_ns[0], *(stamps[0] for stamps in self.image_stamps_ns)]))

    @cached_property
    def end_ns(self) -> int:
        """The last image or instant [ns]."""
        return int(max([self.stamps_ns[-1], *(stamps[-1] for stamps in self.image_stamps_ns)]))

    @cached_property
    def frame_ns(self) -> int:
        """Time between two images of a camera, the median over all [ns]; of instants if there are too few images."""
        steps = [np.diff(stamps) for stamps in self.image_stamps_ns]
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


def broken_at_gaps(solved: SolvedRecording, stamps_ns: NDArray[np.int64], values: Array) -> tuple[Array, Array]:
    """Times (N,) [s] and values (N, ...) of a curve (T, ...) at stamps (T,), with a NaN in each gap of time."""
    after = np.flatnonzero(np.diff(stamps_ns) > solved.longest_step_ns) + 1
    return np.insert(solved.seconds(stamps_ns), after, np.nan), np.insert(values, after, np.nan, axis=0)


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
        cameras: dict[str, CameraLog] = defaultdict(CameraLog)
        of_cameras = {
            topic: camera
            for suffix, kind in ((LANDMARKS, LANDMARKS_TYPE), (TRACKS, TRACKS_TYPE), (TIMING, TIMING_TYPE))
            for topic, camera in camera_topics(bag, suffix, kind).items()
        }
        of_stations = camera_topics(bag, SEGMENT_POSES, SEGMENT_POSES_TYPE)
        coupled, outside = EquipmentLog(), StationLog()
        equipment = [EQUIPMENT] if bag.topics.get(EQUIPMENT) == EQUIPMENT_TYPE else []
        judged = [VERDICT] if bag.topics.get(VERDICT) == VERDICT_TYPE else []
        verdict = None
        for topic, _, message in bag.messages([*MOTION_TOPICS, *equipment, *judged, *of_cameras, *of_stations]):
            if topic in MOTION_TOPICS:
                body.add(topic, message)
                continue
            with contradictions_named(path, topic):
                if topic in equipment:
                    coupled.add(stamp_ns(message.header.stamp), equipment_report(message))
                elif topic in judged:
                    verdict = parse_verdict(message.data)
                elif topic in of_stations:
                    outside.add(message)
                else:
                    cameras[of_cameras[topic]].add(topic, message, of_cameras[topic])
    order = {camera: place for place, camera in enumerate(urdf.cameras)}
    records = [messages.record(camera) for camera, messages in cameras.items() if messages.landmarks]
    stations = outside.records()
    if not records and not stations:
        raise RecordingError(
            f"{path}: no message on /<camera>{LANDMARKS} can be read; another version of bodycam wrote this bag: "
            "replay the recording again"
        )
    records.sort(key=lambda record: (order.get(record.camera, len(order)), record.camera))
    return SolvedRecording(path, urdf, body.joined(), tuple(records), coupled.record(), stations, verdict)


def _check_topics(bag: BagFile) -> None:
    for topic, wanted in _BODY_TOPICS.items():
        kind = bag.topics.get(topic)
        if kind is not None and kind != wanted:
            raise RecordingError(f"{bag.path}: {topic} is {kind}, expected {wanted}")
        if kind is None or bag.message_count(topic) == 0:
            _refuse(bag, f"{'no topic' if kind is None else 'no message on'} {topic}")
    of_cameras = camera_topics(bag, LANDMARKS, LANDMARKS_TYPE) | camera_topics(bag, SEGMENT_POSES, SEGMENT_POSES_TYPE)
    if not any(map(bag.message_count, of_cameras)):
        _refuse(bag, f"no topic /<camera>{LANDMARKS} ({LANDMARKS_TYPE}) with messages")


def _refuse(bag: BagFile, what: str) -> None:
    raise RecordingError(
        f"{bag.path}: {what}; expected a bag that 'bodycam replay' wrote, or a recording of all topics of the live "
        f"graph; there are: {', '.join(bag.topics) or 'none at all'}"
    )
