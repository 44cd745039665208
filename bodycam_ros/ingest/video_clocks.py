"""Where cameras' videos lie in one time: by their sound, by their motion where that is silent, else by their files."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from threading import Event

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.calibration.rig import Rig
from bodycam_ros.errors import RecordingError
from bodycam_ros.ingest.angular_speed import AngularSpeed, angular_speed
from bodycam_ros.ingest.camera_offsets import Offsets, Progress, TimeSource, camera_times
from bodycam_ros.ingest.camera_time import CameraTime
from bodycam_ros.ingest.clock_times import creation_clock, satellite_clock
from bodycam_ros.ingest.ingest_camera import IngestCamera
from bodycam_ros.ingest.motion_sync import motion_times
from bodycam_ros.ingest.side_by_side import for_each_camera
from bodycam_ros.ingest.sound_settings import SoundSettings
from bodycam_ros.video.video_frame import grey_pixels


@dataclass
class MotionClock:
    """A source of camera times: how the cameras turned. It is asked only where somebody is not placed yet.

    To decode all images takes long, and the body finds the clocks of those who are placed far better than this.

    Attributes:
        cameras: all of them.
        rig: which camera is on which segment, if that is known.
        on_progress: told how far it is.
        name, confidence, remarks: see ``TimeSource``.
    """

    cameras: Sequence[IngestCamera]
    rig: Rig | None
    on_progress: Progress
    name: str = "motion"
    confidence: Mapping[str, float] = field(default_factory=dict)
    remarks: Sequence[str] = ()

    def __call__(self, known: Mapping[str, CameraTime]) -> Mapping[str, CameraTime]:
        """Clocks of the cameras that it can tell."""
        if all(camera.name in known for camera in self.cameras):
            return {}
        told = motion_times(self._speeds(), self.rig)
        self.confidence, self.remarks = told.confidence, told.remarks
        return told.times

    def _speeds(self) -> dict[str, AngularSpeed]:
        """How the cameras turned, those whose videos can be decoded; several at once."""
        by_name = {camera.name: camera for camera in self.cameras}
        turned = for_each_camera(
            by_name,
            lambda name, ended: _speed(by_name[name], ended),
            lambda done, of: self.on_progress("following how cameras turn", done, of),
        )
        return {name: speed for name, speed in turned.items() if speed is not None}


def video_clocks(
    cameras: Sequence[IngestCamera],
    rig: Rig | None,
    settings: SoundSettings,
    on_progress: Progress = lambda what, done, of: None,
) -> Offsets:
    """Find the clocks of all cameras; see ``camera_times``.

    Raises:
        RecordingError: nobody can place two cameras.
    """
    videos = [camera.video for camera in cameras]
    others: list[TimeSource] = [MotionClock(cameras, rig, on_progress), satellite_clock(videos), creation_clock(videos)]
    sounds = {video.camera: video.sound for video in videos}
    return camera_times(sounds, None if rig is None else rig.cameras, others, settings, on_progress)


def _speed(camera: IngestCamera, ended: Event) -> AngularSpeed | None:
    """How a camera turned; None of a video that cannot be decoded, which is named when it is written."""
    try:
        return angular_speed(camera.lens, _grey_images(camera, ended))
    except RecordingError:
        return None


def _grey_images(camera: IngestCamera, ended: Event) -> Iterator[tuple[float, NDArray[np.uint8]]]:
    for media_s, frame in camera.video.frames(threads=1):
        if ended.is_set():
            return
        yield media_s, grey_pixels(frame)
