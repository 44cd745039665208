"""Samples of one or more videos, as cameras wrote them: the times of all frames, and some keyframes."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from bodycam_ros.doctor.sampled_recording import Grey, Instants, SampledCamera, SampledRecording
from bodycam_ros.errors import LensError, RecordingError
from bodycam_ros.ingest.find_videos import CameraFiles, find_videos
from bodycam_ros.ingest.ingest_camera import open_video, read_lens
from bodycam_ros.video.camera_video import CameraVideo
from bodycam_ros.video.video_file import frame_times, keyframe_near
from bodycam_ros.video.video_frame import grey_pixels


def sample_videos(
    path: Path, lens_folder: Path | None, instants: Instants, on_instant: Callable[[], None]
) -> SampledRecording:
    """Read what the checks need; of each camera in its own time, since nobody has brought them together yet.

    Args:
        path: folder with videos, or one of them.
        lens_folder: where the lens YAMLs are; None: beside the videos.
        instants: at which to look, of a recording of some seconds.
        on_instant: called after each of all cameras together.

    Raises:
        RecordingError: it is missing, holds no video, or none that can be read.
    """
    found, left_out = find_videos([path], lens_folder)
    videos: list[tuple[CameraFiles, CameraVideo]] = []
    for files in found:
        try:
            videos.append((files, open_video(files)))
        except RecordingError as error:
            left_out.append(f"camera {files.camera}: left out: {error}")
    if not videos:
        raise RecordingError(f"{path}: none of its videos can be read: {'; '.join(left_out)}")
    duration_s = max(video.duration_s for _, video in videos)
    instants_s = instants(duration_s)
    images: dict[str, dict[int, Grey]] = {video.camera: {} for _, video in videos}
    latest: dict[str, float] = {}
    faults: dict[str, str] = {}
    for number, seconds in enumerate(instants_s):
        for _, video in videos:
            _sample(video, number, float(seconds), images[video.camera], latest, faults)
        on_instant()
    cameras = [
        _camera(files, video, lens_folder, images[video.camera], faults.get(video.camera, ""))
        for files, video in videos
    ]
    return SampledRecording(
        path, tuple(cameras), duration_s, instants_s, is_synchronous=False, left_out=tuple(left_out)
    )


def _sample(
    video: CameraVideo,
    number: int,
    seconds: float,
    images: dict[int, Grey],
    latest: dict[str, float],
    faults: dict[str, str],
) -> None:
    """Take the keyframe before an instant, unless it is that of the instant before."""
    if seconds > video.duration_s:
        return
    chapter = [chapter for chapter in video.chapters if chapter.start_s <= seconds][-1]
    try:
        found = keyframe_near(chapter.path, seconds - chapter.start_s)
        if found is not None and (at_s := chapter.start_s + found[0]) != latest.get(video.camera):
            latest[video.camera] = at_s
            turned = np.rot90(grey_pixels(found[1]), chapter.facts.rotation_deg // 90)
            images[number] = np.ascontiguousarray(turned)
    except RecordingError as error:
        faults.setdefault(video.camera, str(error))


def _camera(
    files: CameraFiles, video: CameraVideo, lens_folder: Path | None, images: dict[int, Grey], fault: str
) -> SampledCamera:
    lens, lens_fault = None, ""
    try:
        lens, _ = read_lens(files, lens_folder)
    except LensError as error:
        lens_fault = str(error)
    times = [frame_times(chapter.path) + chapter.start_s for chapter in video.chapters]
    stamps_s = np.sort(np.concatenate(times))  # B-frames are stored in another order than they are shown
    return SampledCamera(
        files.camera, lens, lens_fault, stamps_s, stamps_s, images, fault, has_sound=video.facts.has_sound
    )
