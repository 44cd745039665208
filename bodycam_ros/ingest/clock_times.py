"""Where videos lie in time by what their files say: by satellites, or by the camera's own clock, to a second or so.

Claps, sound and motion know a hundred times better; this is for cameras that they cannot tell, and a first guess.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from threading import Event

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.calibration.rig import Rig
from bodycam_ros.errors import RecordingError
from bodycam_ros.ingest.angular_speed import AngularSpeed, angular_speed
from bodycam_ros.ingest.camera_offsets import Offsets, Progress, TimeSource, camera_times
from bodycam_ros.ingest.camera_time import CameraTime
from bodycam_ros.ingest.frame_stream import for_each_camera
from bodycam_ros.ingest.ingest_camera import IngestCamera
from bodycam_ros.ingest.motion_sync import motion_times
from bodycam_ros.ingest.sound_settings import SoundSettings
from bodycam_ros.recording.camera_video import CameraVideo
from bodycam_ros.recording.video_file import grey_pixels

_OLDEST = datetime(2005, 1, 1, tzinfo=UTC)
"""A clock that says less was never set: cameras begin at 1904, 1970 or 2000."""

_SATELLITE_SIGMA_S = 0.1
"""The reading of satellites is some way behind the payload that it is in, and not the same way in each camera."""

_CLOCK_SIGMA_S = 1.0
_DRIFT_SIGMA = 5e-5  # of a quartz clock


@dataclass
class FileClock:
    """A source of camera times: what each file says of the time of day at its media time 0.

    Attributes:
        name: as ``CameraTime.source`` has it.
        began_s: camera -> UTC at its media time 0 [s since 1970]; cameras that do not know it are not in it.
        sigma_s: how far two of them may differ from each other [s].
        confidence, remarks: see ``TimeSource``; a clock on a wall has none of either.
    """

    name: str
    began_s: Mapping[str, float]
    sigma_s: float
    confidence: Mapping[str, float] = field(default_factory=dict)
    remarks: Sequence[str] = ()

    def __call__(self, known: Mapping[str, CameraTime]) -> dict[str, CameraTime]:
        """Clocks of the cameras that it can tell, in the time of those known, or of the first if none is."""
        shared = [known[camera].start_s - self.began_s[camera] for camera in self.began_s if camera in known]
        if not self.began_s or (known and not shared):
            return {}
        zero_s = float(np.median(shared)) if shared else -next(iter(self.began_s.values()))
        times = {
            camera: CameraTime(camera, began_s + zero_s, 0.0, self.sigma_s, _DRIFT_SIGMA, self.name)
            for camera, began_s in self.began_s.items()
        }
        if not shared:
            first = next(iter(times))
            times[first] = CameraTime(first, 0.0, 0.0, 0.0, 0.0, self.name)
        return times


def satellite_clock(videos: Sequence[CameraVideo]) -> FileClock:
    """By the satellites that a GoPro heard."""
    began_s = {}
    for video in videos:
        try:
            heard = video.satellite_times()
        except RecordingError:
            continue  # whoever reads its frames says so
        if heard:
            began_s[video.camera] = float(np.median([utc_s - media_s for media_s, utc_s in heard]))
    return FileClock("telemetry", began_s, _SATELLITE_SIGMA_S)


def creation_clock(videos: Sequence[CameraVideo]) -> FileClock:
    """By the time of creation that the camera's own clock gave its file, if that was ever set."""
    created = {video.camera: sane(video.created) for video in videos}
    began_s = {camera: time.timestamp() for camera, time in created.items() if time is not None}
    return FileClock("given", began_s, _CLOCK_SIGMA_S)


def sane(created: datetime | None) -> datetime | None:
    """A time of creation, unless the camera's clock was never set or is ahead of ours."""
    if created is None or not _OLDEST < created < datetime.now(UTC) + timedelta(days=1):
        return None
    return created


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
