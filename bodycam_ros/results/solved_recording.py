"""What a replay or a live run published, as arrays: read from its bag, or from one recorded from the live graph."""

from collections import defaultdict
from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera.model import optical_frame
from bodycam_ros.errors import RecordingError
from bodycam_ros.geometry import Array
from bodycam_ros.messages.factory import Message
from bodycam_ros.messages.segment_poses import SEGMENT_POSES, SEGMENT_POSES_TYPE, observed_segments
from bodycam_ros.messages.timing import TIMING, TIMING_TYPE
from bodycam_ros.messages.tracks import landmark_matches
from bodycam_ros.recording.bag_file import BagFile
from bodycam_ros.recording.bag_records import read_bag_records
from bodycam_ros.registration.landmark_matches import LandmarkMatches, camera_sight
from bodycam_ros.results.body_motion import between_neighbours
from bodycam_ros.results.provenance import RECORDING
from bodycam_ros.results.solved_body import GAP_FRAMES, BodyMessages, SolvedBody, missing_topic
from bodycam_ros.results.topics import (
    LANDMARKS,
    LANDMARKS_TYPE,
    clock_history,
    read_landmarks,
    wrong_message_named,
)
from bodycam_ros.results.verdict import VERDICT, VERDICT_TYPE, Verdict, parse_verdict
from bodycam_ros.timing.clock_state import ClockHistory


@dataclass(frozen=True, eq=False)
class StaticCameraRecord:
    """One static camera over K images.

    Attributes:
        station: name.
        stamps_ns: (K,) of its images, increasing [ns].
        segments: (K,) how many segments it measured.
        confidence: (K,) mean over the segments that it searched for, 0 to 1; 0 where it searched for none.
    """

    station: str
    stamps_ns: NDArray[np.int64]
    segments: NDArray[np.int64]
    confidence: Array

    @property
    def observes(self) -> NDArray[np.bool_]:
        """(K,) whether it measured any segment."""
        observed: NDArray[np.bool_] = self.segments > 0
        return observed


@dataclass(frozen=True, eq=False)
class CameraRecord:
    """One body camera over K images.

    Attributes:
        camera: name.
        stamps_ns: (K,) of its images, corrected by its clock, increasing [ns].
        landmarks: (K,) tracks that carry a landmark of the map.
        world_T_camera: (K, 4, 4) registered pose of the optical frame [m]; NaN without one.
        sights: (K,) a ``CameraSight`` each.
        timing: its clock; None in a bag without it.
    """

    camera: str
    stamps_ns: NDArray[np.int64]
    landmarks: NDArray[np.int64]
    world_T_camera: Array
    sights: NDArray[np.int64]
    timing: ClockHistory | None = None

    def time_of(self, stamps_ns: NDArray[np.int64]) -> NDArray[np.int64]:
        """Stamps (N,) of images by the camera's own clock, as times of the recording [ns]."""
        return stamps_ns if self.timing is None else self.timing.corrected_ns(stamps_ns)

    @property
    def registered(self) -> NDArray[np.bool_]:
        """(K,) whether it has a pose."""
        known: NDArray[np.bool_] = np.isfinite(self.world_T_camera[:, 0, 0])
        return known


@dataclass(frozen=True, eq=False)
class SolvedRecording(SolvedBody):
    """The body over T states, and the cameras that it was solved from.

    Attributes:
        cameras: body cameras, in the order of the body's mounts.
        stations: static cameras; without any there are body cameras.
        stored_verdict: of the replay; None in a bag of the live graph.
        zero_ns: stamp of the first image of the recording [ns], where the bag has it: its first states may come later.
    """

    cameras: tuple[CameraRecord, ...]
    stations: tuple[StaticCameraRecord, ...] = ()
    stored_verdict: Verdict | None = None
    zero_ns: int | None = None

    @property
    def image_stamps_ns(self) -> list[NDArray[np.int64]]:
        """(K,) stamps of the images of each camera, on the body or static [ns]."""
        return [*(record.stamps_ns for record in self.cameras), *(record.stamps_ns for record in self.stations)]

    @cached_property
    def start_ns(self) -> int:
        """The first image or state [ns]."""
        return int(min([self.stamps_ns[0], *(stamps[0] for stamps in self.image_stamps_ns)]))

    @cached_property
    def end_ns(self) -> int:
        """The last image or state [ns]."""
        return int(max([self.stamps_ns[-1], *(stamps[-1] for stamps in self.image_stamps_ns)]))

    @cached_property
    def frame_ns(self) -> int:
        """Time between two images of a camera, the median over all [ns]; of states if there are too few images."""
        steps = [np.diff(stamps) for stamps in self.image_stamps_ns]
        together = np.concatenate(steps if any(map(len, steps)) else [np.diff(self.stamps_ns)])
        return int(np.median(together)) if len(together) else 1

    @cached_property
    def longest_step_ns(self) -> float:
        """States that are further apart have a gap between them [ns]; states are no nearer than images."""
        return GAP_FRAMES * max(self.frame_ns, self.step_ns)

    @property
    def duration_s(self) -> float:
        """From the first image to the end of the last [s]."""
        return 1e-9 * (self.end_ns - self.start_ns + self.frame_ns)

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
        """Stamps [ns] as times since the first image of the recording [s]."""
        zero_ns = self.start_ns if self.zero_ns is None else self.zero_ns
        return np.asarray((stamps_ns - zero_ns) * 1e-9, dtype=np.float64)

    def is_solved_at(self, stamps_ns: NDArray[np.int64]) -> NDArray[np.bool_]:
        """(N,) whether stamps (N,) [ns] lie between states, without a gap."""
        return between_neighbours(self.stamps_ns, stamps_ns, self.longest_step_ns)

    def solved_cameras(self) -> Iterator[tuple[CameraRecord, Array]]:
        """Each camera that the body mounts, with its solved poses world_T_camera (T, 4, 4) [m]."""
        for record in self.cameras:
            if record.camera in self.body.mounts:
                yield record, self.world_T_link[optical_frame(record.camera)]

    def curve(self, stamps_ns: NDArray[np.int64], values: Array) -> tuple[Array, Array]:
        """Times (N,) [s] and values (N, ...) of a curve (T, ...) at stamps (T,), with a NaN in each gap of time."""
        after = np.flatnonzero(np.diff(stamps_ns) > self.longest_step_ns) + 1
        return np.insert(self.seconds(stamps_ns), after, np.nan), np.insert(values, after, np.nan, axis=0)


def read_solved(path: Path) -> SolvedRecording:
    """Read what was solved.

    Args:
        path: ros2 bag folder or .mcap file.

    Raises:
        RecordingError: not a bag, a topic of the contract is missing or empty, or the topics do not fit each other.
    """
    with BagFile(path) as bag:
        messages = BodyMessages(bag)
        landmarks = bag.camera_topics(LANDMARKS, LANDMARKS_TYPE)
        static = bag.camera_topics(SEGMENT_POSES, SEGMENT_POSES_TYPE)
        if not any(map(bag.message_count, landmarks | static)):
            raise missing_topic(bag, f"no topic /<camera>{LANDMARKS} ({LANDMARKS_TYPE}) with messages")
        timing = bag.camera_topics(TIMING, TIMING_TYPE)
        judged = [VERDICT] if bag.topics.get(VERDICT) == VERDICT_TYPE else []
        registered: dict[str, _Rows] = defaultdict(dict)
        observed: dict[str, _Rows] = defaultdict(dict)
        timings: dict[str, list[Message]] = defaultdict(list)
        verdict = None
        for topic, _, message in bag.messages([*messages.topics, *judged, *landmarks, *timing, *static]):
            if topic in messages.topics:
                messages.add(topic, message)
                continue
            with wrong_message_named(path, topic):
                if topic in judged:
                    verdict = parse_verdict(message.data)
                elif topic in timing:
                    timings[timing[topic]].append(message)
                elif topic in landmarks:
                    matches = landmark_matches(message, landmarks[topic])
                    pose = _UNKNOWN if matches.world_T_camera is None else matches.world_T_camera
                    row = len(matches.landmark_ids), pose, camera_sight(matches)
                    registered[matches.camera][matches.stamp_ns] = row
                else:
                    station, stamp_ns, count, confidence = observed_segments(message)
                    observed[station][stamp_ns] = count, confidence
    solved = messages.solved()
    order = {camera: place for place, camera in enumerate(solved.body.mounts)}
    cameras = []
    for camera in sorted(registered, key=lambda camera: (order.get(camera, len(order)), camera)):
        clock, (given_ns, counts, poses, sights) = clock_history(camera, timings[camera]), _columns(registered[camera])
        stamps_ns = given_ns if clock is None else clock.corrected_ns(given_ns)
        cameras.append(CameraRecord(camera, stamps_ns, counts, poses, sights, clock))
    stations = tuple(StaticCameraRecord(station, *_columns(rows)) for station, rows in sorted(observed.items()))
    if not cameras and not stations:
        raise RecordingError(
            f"{path}: no message on /<camera>{LANDMARKS} can be read; another version of bodycam wrote this bag: "
            "replay the recording again"
        )
    record = read_bag_records(path).metadata.get(RECORDING, {})
    first_stamp = record.get("first_stamp_ns", "")
    zero_ns = int(first_stamp) if first_stamp.isdecimal() else None
    return SolvedRecording(
        **vars(solved), cameras=tuple(cameras), stations=stations, stored_verdict=verdict, zero_ns=zero_ns
    )


_Rows = dict[int, tuple[Any, ...]]
"""Stamp [ns] -> what was measured at it."""

_UNKNOWN = np.full((4, 4), np.nan)


def _columns(rows: _Rows) -> "Iterator[NDArray[Any]]":
    """Stamps (K,), in order of time, and each of what was measured (K, ...)."""
    stamps_ns = sorted(rows)
    return map(np.array, (stamps_ns, *zip(*(rows[stamp] for stamp in stamps_ns), strict=True)))
