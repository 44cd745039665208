"""What the cameras of a solved recording measured, over their images."""

import math
from collections import defaultdict
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.geometry import Array
from bodycam_ros.messages.factory import Message
from bodycam_ros.messages.segment_poses import segment_poses
from bodycam_ros.messages.timing import TIMING, clock_state, has_clock
from bodycam_ros.messages.tracks import landmark_matches
from bodycam_ros.registration.landmark_matches import CameraSight, camera_sight
from bodycam_ros.timing.clock_state import ClockHistory, ClockState


@dataclass(frozen=True, eq=False)
class StationRecord:
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


class StationMessages:
    """Collects bodycam_msgs/SegmentPoses of static cameras."""

    def __init__(self) -> None:
        self._measured: dict[str, dict[int, tuple[int, float]]] = defaultdict(dict)

    def add(self, message: Message) -> None:
        """Add a message.

        Raises:
            ValueError: it contradicts itself.
        """
        measured = segment_poses(message)
        confidence = list(measured.confidence.values())
        self._measured[measured.station][measured.stamp_ns] = (
            len(measured.evidence),
            float(np.mean(confidence)) if confidence else 0.0,
        )

    def records(self) -> tuple[StationRecord, ...]:
        """One per static camera, in the order of their names."""
        records = []
        for station, measured in sorted(self._measured.items()):
            stamps = sorted(measured)
            segments, confidence = zip(*(measured[stamp] for stamp in stamps), strict=True)
            records.append(StationRecord(station, np.array(stamps, np.int64), np.array(segments), np.array(confidence)))
        return tuple(records)


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
    sights: NDArray[np.int8]
    timing: ClockHistory | None = None

    def time_of(self, stamps_ns: NDArray[np.int64]) -> NDArray[np.int64]:
        """Stamps (N,) of images by the camera's own clock, as times of the recording [ns]."""
        return stamps_ns if self.timing is None else self.timing.corrected_ns(stamps_ns)

    @property
    def registered(self) -> NDArray[np.bool_]:
        """(K,) whether it has a pose."""
        known: NDArray[np.bool_] = np.isfinite(self.world_T_camera[:, 0, 0])
        return known


class CameraMessages:
    """Collects registrations and clocks of one camera, joined by their stamps."""

    def __init__(self) -> None:
        self._landmarks: dict[int, tuple[int, Array | None, CameraSight]] = {}
        self._clocks: dict[int, ClockState] = {}
        self._readout = (math.nan, math.nan)

    def add(self, topic: str, message: Message, camera: str) -> None:
        """Add a message of the topics of a camera."""
        if topic.endswith(TIMING):
            if has_clock(message):
                clock = clock_state(message)
                self._clocks[clock.since_ns] = clock
            if not math.isnan(message.readout_sigma):
                self._readout = message.readout_time, message.readout_sigma
        else:
            matches = landmark_matches(message, camera)
            known = len(matches.landmark_ids), matches.world_T_camera, camera_sight(matches)
            self._landmarks[matches.stamp_ns] = known

    def record(self, camera: str) -> CameraRecord | None:
        """All images with a registration message; None without any."""
        if not self._landmarks:
            return None
        stamps = sorted(self._landmarks)
        landmarks, poses, sights = zip(*(self._landmarks[stamp] for stamp in stamps), strict=True)
        clocks = tuple(self._clocks[since] for since in sorted(self._clocks))
        timing = ClockHistory(camera, clocks, *self._readout) if clocks else None
        given_ns, unknown = np.array(stamps, np.int64), np.full((4, 4), np.nan)
        return CameraRecord(
            camera=camera,
            stamps_ns=given_ns if timing is None else timing.corrected_ns(given_ns),
            landmarks=np.array(landmarks, np.int64),
            world_T_camera=np.array([unknown if pose is None else pose for pose in poses]),
            sights=np.array(sights, np.int8),
            timing=timing,
        )
