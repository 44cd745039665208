"""What one worn camera knew, over the images of a solved recording."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.geometry import Array
from bodycam_ros.messages.clocks import TIMING, clock_state, says_clock
from bodycam_ros.messages.factory import Message
from bodycam_ros.messages.tracks import landmark_matches, track_frame
from bodycam_ros.registration.camera_sight import CameraSight, camera_sight
from bodycam_ros.solved.image_motion import ImageMotion
from bodycam_ros.timing.clock_history import ClockHistory
from bodycam_ros.timing.clock_state import ClockState

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
