"""Where videos lie in time by what their files say alone: the clock of each camera, to a second or so.

A stand-in where nothing better is known: claps, sound and motion know a thousand times better.
"""

from collections.abc import Sequence
from datetime import UTC, datetime, timedelta

from bodycam_ros.ingest.camera_time import CameraTime
from bodycam_ros.video.camera_video import CameraVideo

_OLDEST = datetime(2005, 1, 1, tzinfo=UTC)
"""A clock that says less was never set: cameras begin at 1904, 1970 or 2000."""

_SIGMA_S = 1.0
_DRIFT_SIGMA = 5e-5  # of a quartz clock
_UNKNOWN_SIGMA_S = 60.0


def clock_times(videos: Sequence[CameraVideo]) -> dict[str, CameraTime]:
    """Camera -> its time, by the time of creation in its files; the first that has one is the reference."""
    began = {video.camera: sane(video.created) for video in videos}
    reference = next((video for video in videos if began[video.camera]), videos[0])
    start = began[reference.camera]
    times = {reference.camera: CameraTime(reference.camera, 0.0, 0.0, 0.0, 0.0, "given")}
    for video in videos:
        if video is reference:
            continue
        created = began[video.camera]
        if start is None or created is None:
            times[video.camera] = CameraTime(video.camera, 0.0, 0.0, _UNKNOWN_SIGMA_S, _DRIFT_SIGMA, "given")
        else:
            later_s = (created - start).total_seconds()
            times[video.camera] = CameraTime(video.camera, later_s, 0.0, _SIGMA_S, _DRIFT_SIGMA, "telemetry")
    return times


def sane(created: datetime | None) -> datetime | None:
    """A time of creation, unless the camera's clock was never set or is ahead of ours."""
    if created is None or not _OLDEST < created < datetime.now(UTC) + timedelta(days=1):
        return None
    return created
