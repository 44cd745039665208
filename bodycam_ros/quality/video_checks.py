"""Checks of videos by the code of ``bodycam ingest``: what it will leave out or doubt, in its words."""

from collections.abc import Iterator, Sequence

import numpy as np

from bodycam_ros.calibration.rig import Rig
from bodycam_ros.errors import RecordingError
from bodycam_ros.ingest.camera_offsets import add_times, creation_times, image_intervals, sound_clocks
from bodycam_ros.ingest.frame_stream import frame_remarks, imu_remark
from bodycam_ros.ingest.inertial_stream import read_inertial_samples
from bodycam_ros.ingest.ingest import overlapping
from bodycam_ros.ingest.ingest_camera import IngestCamera
from bodycam_ros.progress import Progress
from bodycam_ros.quality.sensor_checks import check_sensors
from bodycam_ros.recording.camera_video import CameraVideo
from bodycam_ros.recording.video_file import frame_index
from bodycam_ros.results.verdict import Finding, Level, good

_SOUND_REMEDY = "switch its sound on and clap; 'bodycam ingest' searches its clock by its motion, and may leave it out"


def check_videos(cameras: Sequence[IngestCamera], rig: Rig | None, progress: Progress) -> Iterator[Finding]:
    """Read the sounds, the indices and the inertial samples of videos as an ingest does; no image is decoded.

    Args:
        cameras: that an ingest would take; none for a bag.
        rig: which camera is on which segment, if that is known.
        progress: of the sounds.
    """
    for camera in cameras:
        for remark in _index_remarks(camera):
            yield Finding(camera.name, Level.DOUBTFUL, remark, check="gaps")
    if len(cameras) > 1:
        yield from _check_clocks(cameras, rig, progress)
    sensors = {}
    for camera in cameras:
        try:
            samples = read_inertial_samples(camera)
        except RecordingError as error:
            yield Finding(camera.name, Level.DOUBTFUL, imu_remark(str(error)), check="sensors")
            continue
        if samples is not None:
            sensors[camera.name] = samples
    yield from check_sensors(sensors)


def _check_clocks(cameras: Sequence[IngestCamera], rig: Rig | None, progress: Progress) -> Iterator[Finding]:
    """Find cameras whose sound does not give their clock, and those that run while no other does."""
    check = "clocks"
    segments = None if rig is None else rig.cameras
    sounds = {camera.name: camera.video.sound for camera in cameras}
    by_sound = sound_clocks(sounds, segments, progress, image_intervals(cameras))
    for line in by_sound.remarks:
        yield Finding("", Level.DOUBTFUL, line, part="recording", check=check)
    for name, cause in by_sound.causes.items():
        yield Finding(name, Level.DOUBTFUL, cause, remedy=_SOUND_REMEDY, check=check)
    times = dict(by_sound.times)
    found, _ = creation_times([camera.video for camera in cameras], times)
    for line in add_times("given", found, times, by_sound.causes):
        # Those that it places are named above, and an ingest asks their motion first.
        if not any(line.startswith(f"camera {name}: ") for name in by_sound.causes):
            yield Finding("", Level.DOUBTFUL, line, part="recording", check=check)
    for line in overlapping([camera for camera in cameras if camera.name in times], times)[1]:
        yield Finding("", Level.WRONG, line, part="recording", check=check)
    if by_sound.times:
        yield good(check, f"the sounds of {len(by_sound.times)} videos give their clocks")


def _index_remarks(camera: IngestCamera) -> list[str]:
    """What an ingest that copies the frames of a video will say of those that it cannot copy."""
    video = camera.video
    if not isinstance(video, CameraVideo) or not camera.is_copied:
        return []
    found = [frame_index(chapter.path) for chapter in video.chapters]
    times_s = np.concatenate(
        [times + chapter.start_s for (times, _), chapter in zip(found, video.chapters, strict=True)]
    )
    keys = np.flatnonzero(np.concatenate([is_key for _, is_key in found]))
    without_key = int(keys[0]) if len(keys) else len(times_s)
    shown_s = times_s[without_key:]
    unordered = int((shown_s[1:] <= np.maximum.accumulate(shown_s)[:-1]).sum()) if len(shown_s) else 0
    read = len(times_s) if video.facts.frames > len(times_s) else None
    return frame_remarks(camera, read, without_key, unordered)
