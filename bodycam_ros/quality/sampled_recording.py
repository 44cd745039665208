"""A recording as the checks know it: the times of all images, and some of the images themselves."""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.camera_image import CameraImage, VideoPacket, decode_grey
from bodycam_ros.errors import LensError, RecordingError
from bodycam_ros.geometry import Array
from bodycam_ros.ingest.find_videos import CameraFiles, find_videos
from bodycam_ros.ingest.ingest_camera import open_video, read_lens
from bodycam_ros.quality.doctor_settings import DoctorGroups
from bodycam_ros.recording.bag_reader import Recording, open_recording
from bodycam_ros.recording.camera_video import CameraVideo
from bodycam_ros.recording.video_decoder import decode_last
from bodycam_ros.recording.video_file import frame_times, grey_pixels, keyframe_near
from bodycam_ros.registration.image_registration import ImageRegistration, ImageRegistrationSettings
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.tracking.feature_tracker import view_mask

Grey = NDArray[np.uint8]

Instants = Callable[[float], Array]
"""Duration of a recording [s] -> (K,) the instants at which to look into it [s]."""

_WIDEST_DEG = 90.0
"""Fisheye pictures are black farther out."""


@dataclass(frozen=True, eq=False)
class SampledCamera:
    """One camera.

    Attributes:
        name: of the camera.
        lens: its model; None if there is none that can be used.
        lens_fault: why.
        stamps_s: (N,) of its images as they were recorded, since the recording's start [s].
        recorded_s: (N,) when they were recorded, likewise; the same as the stamps where nobody knows.
        images: number of an instant -> (H, W) the image nearest to it; instants without one are left out.
        fault: why images that should be there cannot be decoded; empty if they can.
        missing: images that the recording says it holds, but does not.
        has_sound: whether its video has sound; None if it is no video file.
    """

    name: str
    lens: CameraModel | None
    lens_fault: str
    stamps_s: Array
    recorded_s: Array
    images: Mapping[int, Grey]
    fault: str = ""
    missing: int = 0
    has_sound: bool | None = None

    @property
    def interval_s(self) -> float:
        """Between two images, median [s]; NaN where there are no two."""
        steps = np.diff(np.sort(self.stamps_s))
        steps = steps[steps > 0.0]
        return float(np.median(steps)) if len(steps) else float("nan")

    @cached_property
    def lit(self) -> Grey | None:
        """(H, W) 255 where the lens draws a picture; None where nobody knows, or images have another size."""
        sizes = {grey.shape for grey in self.images.values()}
        if self.lens is None or sizes - {(self.lens.height, self.lens.width)}:
            return None
        return view_mask(self.lens, _WIDEST_DEG)


@dataclass(frozen=True, eq=False)
class SampledRecording:
    """All cameras.

    Attributes:
        path: of the recording.
        cameras: by name.
        duration_s: of the recording [s].
        instants_s: (K,) instants of the sampled images, since the start [s].
        is_synchronous: whether stamps of different cameras are of one time, as in a bag; videos are brought to it by
            ``bodycam ingest``.
        left_out: cameras that cannot be read, and why.
    """

    path: Path
    cameras: tuple[SampledCamera, ...]
    duration_s: float
    instants_s: Array
    is_synchronous: bool
    left_out: tuple[str, ...] = ()


def spread_instants(duration_s: float, count: int) -> Array:
    """(K,) instants, evenly over a recording, in the middle of equal parts [s]."""
    return (np.arange(count) + 0.5) * duration_s / count


_BEFORE_S = 4.0
"""A video's frame is made of those since its keyframe; of cameras few are farther apart."""

_NEAR = 1.5
"""Intervals between a camera's images by which the one of an instant may be later."""


def sample_bag(path: Path, instants: Instants, on_instant: Callable[[], None]) -> SampledRecording:
    """Read what the checks need.

    Args:
        path: ros2 bag folder or .mcap file.
        instants: at which to look, of a recording of some seconds.
        on_instant: called after each.

    Raises:
        RecordingError: not a recording, or damaged.
    """
    with open_recording(path) as recording:
        times = recording.image_times()
        instants_s = instants(recording.duration_s)
        images: dict[str, dict[int, Grey]] = {camera: {} for camera in recording.cameras}
        faults: dict[str, str] = {}
        for number, seconds in enumerate(instants_s):
            for camera, grey in _at(recording, times, float(seconds), faults).items():
                images[camera][number] = grey
            on_instant()
        cameras = [
            _camera(recording, camera, times[camera], images[camera], faults.get(camera, ""))
            for camera in recording.cameras
        ]
        return SampledRecording(path, tuple(cameras), recording.duration_s, instants_s, is_synchronous=True)


def _camera(
    recording: Recording, camera: str, times_ns: NDArray[np.int64], images: dict[int, Grey], fault: str
) -> SampledCamera:
    lens, lens_fault = _lens(recording, camera)
    recorded_s, stamps_s = 1e-9 * (times_ns - recording.start_ns).T
    return SampledCamera(
        camera,
        lens,
        lens_fault,
        stamps_s,
        recorded_s,
        images,
        fault,
        missing=max(0, recording.image_count(camera) - len(times_ns)),
    )


def _lens(recording: Recording, camera: str) -> tuple[CameraModel | None, str]:
    try:
        return recording.camera_model(camera), ""
    except LensError as error:
        return None, str(error)


def _at(
    recording: Recording, times: dict[str, NDArray[np.int64]], seconds: float, faults: dict[str, str]
) -> dict[str, Grey]:
    """Camera -> the image recorded at an instant, or soon after it."""
    start_ns = recording.start_ns + round(1e9 * seconds)
    found: dict[str, Grey] = {}
    for packets_before_s in (0.0, _BEFORE_S):  # only of videos what came before is needed
        asked = [camera for camera in recording.cameras if camera not in found and len(times[camera]) > 1]
        reach_ns = round(_NEAR * max((_interval_ns(times[camera][:, 0]) for camera in asked), default=0.0)) + 1
        by_camera: dict[str, list[CameraImage]] = {}
        for image in recording.encoded_between(asked, start_ns - round(1e9 * packets_before_s), start_ns + reach_ns):
            by_camera.setdefault(image.camera, []).append(image)
        for camera, images in by_camera.items():
            recorded_ns = times[camera][:, 0]
            until = int((recorded_ns < start_ns + reach_ns).sum())
            first = int((recorded_ns < start_ns).sum()) - (until - len(images))
            chosen = _decodable(images[: max(first, 0) + 1])
            if chosen is None or first >= len(images):
                continue
            try:
                found[camera] = decode_grey(decode_last(chosen))
            except RecordingError as error:
                faults.setdefault(camera, str(error))
    return found


def _decodable(images: Sequence[CameraImage]) -> Sequence[CameraImage] | None:
    """The last image, and of a video those since its keyframe; None if that is not among them."""
    for row in range(len(images) - 1, -1, -1):
        content = images[row].content
        if not isinstance(content, VideoPacket) or content.is_key:
            return images[row:]
    return None


def _interval_ns(recorded_ns: NDArray[np.int64]) -> float:
    steps: Array = np.diff(recorded_ns).astype(np.float64)
    return float(np.median(steps))


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
        _camera_of_video(files, video, lens_folder, images[video.camera], faults.get(video.camera, ""))
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


def _camera_of_video(
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


_HOPELESS = 2
"""Instants at which no camera finds itself; the others are not asked: a wrong map would cost the most."""


@dataclass(frozen=True, eq=False)
class RegisteredSamples:
    """Of one recording.

    Attributes:
        instants_s: (K,) the recording's sampled instants [s].
        poses: camera -> number of an instant -> (4, 4) world_T_camera, or None where the image cannot be registered.
    """

    instants_s: Array
    poses: Mapping[str, Mapping[int, Array | None]]

    def share(self, camera: str) -> float:
        """Of a camera's images that were registered; NaN if none was asked."""
        found = [pose is not None for pose in self.poses.get(camera, {}).values()]
        return float(np.mean(found)) if found else float("nan")

    def known(self, camera: str) -> dict[int, Array]:
        """Number of an instant -> world_T_camera (4, 4) where it is known."""
        return {number: pose for number, pose in self.poses.get(camera, {}).items() if pose is not None}


def register_samples(
    recording: SampledRecording,
    cameras: Sequence[str],
    instants: Sequence[int],
    reference_map: ReferenceMap,
    settings: DoctorGroups,
    jobs: int,
    on_instant: Callable[[], None],
) -> RegisteredSamples:
    """Register the images of some cameras at some instants.

    Args:
        recording: samples.
        cameras: names of those to ask.
        instants: numbers of instants, in the order in which to ask.
        reference_map: the map.
        settings: of the registration.
        jobs: threads.
        on_instant: called after each instant at which there is an image to ask.
    """
    asked = [camera for camera in recording.cameras if camera.name in cameras and camera.lens is not None]
    registrations = {camera.name: _registration(camera, reference_map, settings) for camera in asked}
    poses: dict[str, dict[int, Array | None]] = {camera.name: {} for camera in asked}
    lit = {camera.name: camera.lit for camera in asked}

    def register(work: tuple[str, int, Grey]) -> None:
        name, number, grey = work
        poses[name][number] = registrations[name].register(grey, lit[name]).world_T_camera

    with ThreadPoolExecutor(jobs) as pool:
        seen = [number for number in instants if any(_fits(camera, camera.images.get(number)) for camera in asked)]
        for count, number in enumerate(seen):
            work = [(c.name, number, c.images[number]) for c in asked if _fits(c, c.images.get(number))]
            if count == 0:
                register(work.pop())  # what the map learns for a search, it learns once
            list(pool.map(register, work))
            on_instant()
            if count + 1 == _HOPELESS and not any(pose is not None for of in poses.values() for pose in of.values()):
                break
    return RegisteredSamples(recording.instants_s, poses)


def _registration(camera: SampledCamera, reference_map: ReferenceMap, settings: DoctorGroups) -> ImageRegistration:
    assert camera.lens is not None
    return ImageRegistration(
        camera.lens,
        reference_map,
        ImageRegistrationSettings(),
        settings.registrar,
        settings.matching,
        settings.absolute_pose,
        settings.pose_fit,
    )


def _fits(camera: SampledCamera, grey: NDArray[np.uint8] | None) -> bool:
    return grey is not None and camera.lens is not None and grey.shape == (camera.lens.height, camera.lens.width)
