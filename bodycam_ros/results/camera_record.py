"""What one worn camera knew, over the images of a solved recording."""

import math
from collections import defaultdict
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.geometry import Array
from bodycam_ros.messages.factory import Message
from bodycam_ros.messages.segment_poses import segment_poses
from bodycam_ros.messages.timing import TIMING, clock_state, has_clock
from bodycam_ros.messages.tracks import landmark_matches, track_frame
from bodycam_ros.registration.landmark_matches import CameraSight, camera_sight
from bodycam_ros.timing.clock_state import ClockHistory, ClockState


@dataclass(frozen=True, eq=False)
class StationRecord:
    """One static camera over K images.

    Attributes:
        station: name.
        stamps_ns: (K,) of its images, increasing [ns].
        segments: (K,) how many it said something of.
        confidence: (K,) mean over the segments that it looked for, 0 to 1; 0 where it looked for none.
    """

    station: str
    stamps_ns: NDArray[np.int64]
    segments: NDArray[np.int64]
    confidence: Array

    @property
    def observes(self) -> NDArray[np.bool_]:
        """(K,) whether it said something of any segment."""
        seen: NDArray[np.bool_] = self.segments > 0
        return seen


class StationLog:
    """Messages of static cameras, on their way to records."""

    def __init__(self) -> None:
        self._said: dict[str, dict[int, tuple[int, float]]] = defaultdict(dict)

    def add(self, message: Message) -> None:
        """Take a bodycam_msgs/SegmentPoses.

        Raises:
            ValueError: it contradicts itself.
        """
        said = segment_poses(message)
        shares = list(said.confidence.values())
        self._said[said.station][said.stamp_ns] = len(said.evidence), float(np.mean(shares)) if shares else 0.0

    def records(self) -> tuple[StationRecord, ...]:
        """What each said, in the order of their names."""
        return tuple(
            StationRecord(
                station,
                np.array(sorted(said), dtype=np.int64),
                np.array([said[stamp][0] for stamp in sorted(said)], dtype=np.int64),
                np.array([said[stamp][1] for stamp in sorted(said)], dtype=np.float64),
            )
            for station, said in sorted(self._said.items())
        )


_LEAST_TRACKS = 5


class ImageMotion:
    """Follows the tracks of one camera from image to image."""

    def __init__(self) -> None:
        self._ids = np.zeros(0, np.uint32)
        self._pixels = np.zeros((0, 2), np.float32)

    def add(self, track_ids: NDArray[np.uint32], pixels: NDArray[np.float32]) -> float:
        """The median length [px] that tracks (N,) at pixels (N, 2) moved since the image before; NaN of too few."""
        _, now, before = np.intersect1d(track_ids, self._ids, assume_unique=True, return_indices=True)
        moved = np.linalg.norm(pixels[now] - self._pixels[before], axis=1)
        self._ids, self._pixels = track_ids, pixels
        return float(np.median(moved)) if len(moved) >= _LEAST_TRACKS else float("nan")


TRACKS, TRACKS_TYPE = "/tracks", "bodycam_msgs/msg/FeatureTracks"
"""End and type of a camera's topic of feature tracks."""


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


class CameraLog:
    """Registrations and tracks of one camera, to be joined by their stamps."""

    def __init__(self) -> None:
        self.landmarks: dict[int, tuple[int, Array | None, CameraSight]] = {}
        self._tracks: dict[int, tuple[int, float]] = {}
        self._motion = ImageMotion()
        self._clocks: dict[int, ClockState] = {}
        self._readout = (math.nan, math.nan)

    def add(self, topic: str, message: Message, camera: str) -> None:
        """Take a message of the topics of a camera."""
        if topic.endswith(TRACKS):
            frame = track_frame(message, camera)
            self._tracks[frame.stamp_ns] = (len(frame.track_ids), self._motion.add(frame.track_ids, frame.pixels))
            return
        if topic.endswith(TIMING):
            if has_clock(message):
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
        """What the camera knew."""
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
