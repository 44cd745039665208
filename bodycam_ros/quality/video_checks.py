"""Checks of videos by the code of ``bodycam ingest``: what it will leave out or doubt, in its words."""

from collections.abc import Iterator, Sequence

import numpy as np

from bodycam_ros.calibration.rig import Rig
from bodycam_ros.errors import RecordingError
from bodycam_ros.ingest.camera_offsets import (
    aligned,
    contradictions,
    creation_times,
    image_intervals,
    sound_clocks,
)
from bodycam_ros.ingest.camera_remarks import left_out
from bodycam_ros.ingest.frame_stream import frame_remarks, imu_remark
from bodycam_ros.ingest.inertial_stream import read_inertial_samples
from bodycam_ros.ingest.ingest import overlapping
from bodycam_ros.ingest.ingest_camera import IngestCamera
from bodycam_ros.progress import Progress
from bodycam_ros.quality.sensor_checks import check_sensors
from bodycam_ros.recording.camera_video import CameraVideo
from bodycam_ros.recording.image_folder import ImageFolder
from bodycam_ros.recording.video_file import frame_index
from bodycam_ros.results.verdict import Finding, Level, good

_SOUND_REMEDY = "switch its sound on and clap; 'bodycam ingest' searches its clock by its motion, and may leave it out"
_IMAGES_REMEDY = (
    "'bodycam ingest' searches the clock of images by their motion, and may leave the camera out; --synchronous or "
    "--offsets give it"
)


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
            yield Finding(camera.name, Level.DOUBTFUL, imu_remark(error.cause), check="sensors")
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
    for name, fault in by_sound.faults.items():
        yield Finding(name, Level.DOUBTFUL, fault, check=check)
    of_images = {camera.name for camera in cameras if isinstance(camera.video, ImageFolder)}
    for name, cause in by_sound.causes.items():
        remedy = _IMAGES_REMEDY if name in of_images else _SOUND_REMEDY
        yield Finding(name, Level.DOUBTFUL, cause, remedy=remedy, check=check)
    times = dict(by_sound.times)
    found, _ = creation_times([camera.video for camera in cameras], times)
    found = aligned(found, times)
    for name, remark in contradictions("given", found, times):
        yield Finding(name, Level.DOUBTFUL, remark, check=check)
    # An ingest tries the motion of cameras without a sound before this; to doctor their files' times must do.
    times |= {name: time for name, time in found.items() if name in by_sound.causes}
    for name, why in overlapping([camera for camera in cameras if camera.name in times], times)[1].items():
        yield Finding(name, Level.WRONG, left_out(why), check=check)
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
