"""Samples of a recording for its checks: the times of all images, some images, and their registrations."""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.camera_image import CameraImage, decode_grey, read_image_file
from bodycam_ros.errors import BodycamError, LensError, RecordingError, StaticCameraError
from bodycam_ros.geometry import Array
from bodycam_ros.ingest.camera_remarks import Causes, left_out, left_out_lines
from bodycam_ros.ingest.find_videos import find_videos
from bodycam_ros.ingest.ingest_camera import IngestCamera, check_rate, load_camera, open_files
from bodycam_ros.recording.bag_reader import open_recording
from bodycam_ros.recording.camera_video import CameraVideo
from bodycam_ros.recording.image_folder import ImageFolder
from bodycam_ros.recording.time_span import TimeSpan
from bodycam_ros.recording.topic_names import AS_RECORDED, TopicNames
from bodycam_ros.recording.video_file import DecodedFrame, frame_index, keyframe_near
from bodycam_ros.registration.image_registration import ImageRegistration
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.tracking.feature_tracker import view_mask

Grey = NDArray[np.uint8]

SampleTimes = Callable[[float], Array]
"""Duration of a recording [s] -> (K,) the times to sample [s]."""

_WIDEST_DEG = 90.0
"""From the axis; fisheye pictures are black farther out."""


@dataclass(frozen=True, eq=False)
class SampledCamera:
    """Samples of one camera.

    Attributes:
        name: of the camera.
        lens: its model; None where it cannot be used.
        lens_fault: why.
        stamps_s: (N,) of its images in the order of recording, since the recording's start [s].
        recorded_s: (N,) when they were recorded, likewise; the stamps where that is unknown.
        images: number of a sample -> (H, W) the image nearest to it; samples without one are left out.
        fault: why images cannot be decoded; empty if they can.
        missing: images that the recording declares, but does not hold.
    """

    name: str
    lens: CameraModel | None
    lens_fault: str
    stamps_s: Array
    recorded_s: Array
    images: Mapping[int, Grey]
    fault: str = ""
    missing: int = 0

    @property
    def interval_s(self) -> float:
        """Median time between two images [s]; NaN with fewer than two images."""
        steps = np.diff(np.sort(self.stamps_s))
        steps = steps[steps > 0.0]
        return float(np.median(steps)) if len(steps) else float("nan")

    @cached_property
    def lit(self) -> Grey | None:
        """(H, W) 255 where the lens draws a picture; None where that is unknown, or images have another size."""
        if self.lens is None or not all(self.fits_lens(grey) for grey in self.images.values()):
            return None
        return view_mask(self.lens, _WIDEST_DEG)

    def fits_lens(self, grey: Grey | None) -> bool:
        """Whether there is an image (H, W) of the lens's size."""
        return grey is not None and self.lens is not None and grey.shape == (self.lens.height, self.lens.width)


@dataclass(frozen=True, eq=False)
class SampledRecording:
    """Samples of all cameras.

    Attributes:
        cameras: by name.
        duration_s: of the recording [s].
        times_s: (K,) times of the samples, since the start [s].
        is_synchronous: whether stamps of different cameras share a clock, as in a bag; ``bodycam ingest`` synchronises
            videos.
        left_out: camera that cannot be read -> why.
        videos: that ingest would take; empty for a bag.
        is_simultaneous: whether samples of one number are of one time, in all cameras.
    """

    cameras: tuple[SampledCamera, ...]
    duration_s: float
    times_s: Array
    is_synchronous: bool
    left_out: Causes = field(default_factory=dict)
    videos: tuple[IngestCamera, ...] = ()
    is_simultaneous: bool = True


def spread_times(duration_s: float, count: int) -> Array:
    """(K,) times, evenly over a recording, in the middle of equal parts [s]."""
    return (np.arange(count) + 0.5) * duration_s / count


def sampled_part(recording: SampledRecording, span: TimeSpan) -> SampledRecording:
    """The times and images of a part; times of cameras count from its start.

    Raises:
        RecordingError: the recording has no image in that time, or its videos have no common time.
    """
    if span == TimeSpan():
        return recording
    if not recording.is_synchronous:
        raise RecordingError(
            "videos have no common time yet, so --from and --to have no meaning; run 'bodycam ingest' first"
        )
    end_s = min(span.to_s, recording.duration_s)
    cameras = []
    for camera in recording.cameras:
        rows = (camera.recorded_s >= span.from_s) & (camera.recorded_s < end_s)
        images = {n: grey for n, grey in camera.images.items() if span.from_s <= recording.times_s[n] < end_s}
        stamps_s, recorded_s = camera.stamps_s[rows] - span.from_s, camera.recorded_s[rows] - span.from_s
        cameras.append(replace(camera, stamps_s=stamps_s, recorded_s=recorded_s, images=images))
    if not any(len(camera.stamps_s) for camera in cameras):
        raise RecordingError(f"there is no image {span.text}; the recording lasts {recording.duration_s:.1f} s")
    return replace(recording, cameras=tuple(cameras), duration_s=end_s - span.from_s)


_KEYFRAMES = 6  # of a video: each image decoded costs a millisecond or two, and each frame since its keyframe as well
_NEAR_INTERVALS = 1.5  # between a camera's images, by which the image of a sample may be later


def sample_bag(
    path: Path, sample_times: SampleTimes, on_sample: Callable[[], None], names: TopicNames = AS_RECORDED
) -> SampledRecording:
    """Sample a bag.

    Args:
        path: ros2 bag folder or .mcap file.
        sample_times: times to sample.
        on_sample: called after each.
        names: of its topics.

    Raises:
        RecordingError: not a recording, or damaged.
    """
    with open_recording(path, names) as recording:
        times = recording.image_times()
        times_s = sample_times(recording.duration_s)
        images: dict[str, dict[int, Grey]] = {camera: {} for camera in recording.cameras}
        faults: dict[str, str] = {}
        videos = recording.keyframe_samples(_KEYFRAMES)
        stills = {camera: each for camera, each in times.items() if camera not in videos}

        def add(camera: str, number: int, image: CameraImage) -> None:
            try:
                images[camera][number] = decode_grey(image)
            except RecordingError as error:
                faults.setdefault(camera, error.cause)

        for camera, numbered in videos.items():
            for number, image in numbered.items():
                add(camera, number, image)
        if videos:
            # All that other cameras need is as many.
            times_s = spread_times(recording.duration_s, 2 * _KEYFRAMES)
        for number, seconds in enumerate(times_s.tolist()):
            rows = _rows_at(stills, recording.start_ns + round(1e9 * seconds))
            for camera, image in (recording.images_at(rows) if rows else {}).items():
                add(camera, number, image)
            on_sample()
        cameras = []
        for camera in recording.cameras:
            lens, lens_fault = _lens_or_fault(partial(recording.camera_model, camera))
            recorded_s, stamps_s = 1e-9 * (times[camera] - recording.start_ns).T
            missing = max(0, recording.image_count(camera) - len(times[camera]))
            fault = faults.get(camera, "")
            cameras.append(
                SampledCamera(camera, lens, lens_fault, stamps_s, recorded_s, images[camera], fault, missing)
            )
        return SampledRecording(
            tuple(cameras), recording.duration_s, times_s, is_synchronous=True, is_simultaneous=not videos
        )


def _rows_at(times: Mapping[str, NDArray[np.int64]], start_ns: int) -> dict[str, tuple[int, int]]:
    """Camera -> its row of ``image_times`` that was recorded at a time or soon after."""
    rows = {}
    for camera, each in times.items():
        row = int(np.searchsorted(each[:, 0], start_ns))
        if 1 < len(each) and row < len(each):
            recorded_ns, stamp_ns = each[row].tolist()
            if recorded_ns - start_ns <= _NEAR_INTERVALS * float(np.median(np.diff(each[:, 0]))):
                rows[camera] = recorded_ns, stamp_ns
    return rows


def _lens_or_fault(read: Callable[[], CameraModel]) -> tuple[CameraModel | None, str]:
    try:
        return read(), ""
    except LensError as error:
        return None, error.cause


def sample_videos(
    path: Path,
    lens_folder: Path | None,
    sample_times: SampleTimes,
    on_sample: Callable[[], None],
    rate_hz: float | None = None,
) -> SampledRecording:
    """Sample videos and folders of images, each at times of its own clock.

    Args:
        path: folder with videos or images, or with a folder for each camera, or a video.
        lens_folder: with the lens YAMLs; None: beside the videos.
        sample_times: times to sample.
        on_sample: called after each, of all cameras together.
        rate_hz: of images that are not named by their stamps.

    Raises:
        RecordingError: the path is missing, holds no video, or none that can be read.
    """
    found, causes = find_videos([path], lens_folder)
    check_rate(found, rate_hz)
    videos: list[CameraVideo | ImageFolder] = []
    taken: list[IngestCamera] = []
    lens_faults: dict[str, str] = {}
    for files in found:
        try:
            videos.append(open_files(files, rate_hz))
        except BodycamError as error:
            causes[files.camera] = error.cause
            continue
        try:
            taken += load_camera(files, lens_folder, rate_hz)
        except (LensError, StaticCameraError) as error:
            lens_faults[files.camera] = left_out(error.cause)
        except BodycamError as error:
            videos.pop()
            causes[files.camera] = error.cause
    if not videos:
        raise RecordingError("\n".join([f"{path}: no camera can be used", *left_out_lines(causes)]))
    lenses = {camera.topic_name: camera.lens for camera in taken}
    duration_s = max(video.facts.duration_s for video in videos)
    times_s = sample_times(duration_s)
    samples: dict[str, dict[float, tuple[int, Grey]]] = {video.camera: {} for video in videos}
    undecodable: dict[str, str] = {}
    for number, seconds in enumerate(times_s.tolist()):
        for video in videos:
            try:
                _add_sample(video, number, seconds, samples[video.camera])
            except RecordingError as error:
                undecodable.setdefault(video.camera, error.cause)
        on_sample()
    cameras = []
    for video in videos:
        name, stamps_s = video.camera, _frame_times(video)
        images, fault = dict(samples[name].values()), undecodable.get(name, "")
        lens, lens_fault = lenses.get(name), lens_faults.get(name, "")
        cameras.append(SampledCamera(name, lens, lens_fault, stamps_s, stamps_s, images, fault))
    return SampledRecording(tuple(cameras), duration_s, times_s, False, causes, tuple(taken))


def _frame_times(video: CameraVideo | ImageFolder) -> Array:
    """(N,) media times of all frames [s], in order; B-frames are not stored so."""
    if isinstance(video, ImageFolder):
        return video.times_s
    return np.sort(np.concatenate([frame_index(each.path)[0] + each.start_s for each in video.chapters]))


def _add_sample(
    video: CameraVideo | ImageFolder, number: int, seconds: float, known: dict[float, tuple[int, Grey]]
) -> None:
    """Add the keyframe before a time, or the image after it, unless it is that of an earlier sample."""
    if seconds > video.facts.duration_s:
        return
    if isinstance(video, ImageFolder):
        row = min(int(np.searchsorted(video.times_s, seconds)), len(video.paths) - 1)
        if (image_s := float(video.times_s[row])) not in known:
            known[image_s] = number, np.asarray(read_image_file(video.paths[row], cv2.IMREAD_GRAYSCALE), np.uint8)
        return
    chapter = [chapter for chapter in video.chapters if chapter.start_s <= seconds][-1]
    found = keyframe_near(chapter.path, seconds - chapter.start_s)
    if found is not None and (keyframe_s := chapter.start_s + found[0]) not in known:
        known[keyframe_s] = number, DecodedFrame(found[1], chapter.facts.rotation_deg).grey()


_HOPELESS = 2
"""Samples in which no camera registers; then the others are left out: a wrong map would cost the most time."""

_MIRRORED = 2  # images of a camera without registration whose mirror images are tried


@dataclass(frozen=True, eq=False)
class RegisteredSamples:
    """Registrations of a recording's samples.

    Attributes:
        times_s: (K,) times of the samples [s].
        poses: camera -> number of a sample -> (4, 4) world_T_camera, or None where the image cannot be registered.
        mirrored: cameras none of whose images can be registered, but whose mirror images can.
    """

    times_s: Array
    poses: Mapping[str, Mapping[int, Array | None]]
    mirrored: frozenset[str] = frozenset()

    def share(self, camera: str) -> float:
        """Share of a camera's images that were registered; NaN if none was tried."""
        found = [pose is not None for pose in self.poses.get(camera, {}).values()]
        return float(np.mean(found)) if found else float("nan")

    def known(self, camera: str) -> dict[int, Array]:
        """Number of a sample -> world_T_camera (4, 4) where it is known."""
        return {number: pose for number, pose in self.poses.get(camera, {}).items() if pose is not None}


def register_samples(
    recording: SampledRecording,
    cameras: Sequence[str],
    numbers: Sequence[int],
    reference_map: ReferenceMap,
    jobs: int,
    on_sample: Callable[[], None],
) -> RegisteredSamples:
    """Register the images of some cameras, each without regard to the others.

    Args:
        recording: samples.
        cameras: names.
        numbers: of the samples, in the order in which they are registered.
        reference_map: the map.
        jobs: threads.
        on_sample: called after each sample with an image.
    """
    usable = {c.name: c for c in recording.cameras if c.name in cameras and c.lens is not None}
    registrations = {n: ImageRegistration(c.lens, reference_map) for n, c in usable.items() if c.lens is not None}
    poses: dict[str, dict[int, Array | None]] = {name: {} for name in usable}

    def register(name: str, number: int) -> None:
        camera = usable[name]
        poses[name][number] = registrations[name].register(camera.images[number], camera.lit).world_T_camera

    with ThreadPoolExecutor(jobs) as pool:
        done = 0
        for number in numbers:
            names = [name for name, camera in usable.items() if camera.fits_lens(camera.images.get(number))]
            if not names:
                continue
            if not done:
                register(names.pop(), number)  # builds the map's search index once
            list(pool.map(register, names, [number] * len(names)))
            on_sample()
            done += 1
            if done == _HOPELESS and not any(pose is not None for of in poses.values() for pose in of.values()):
                break
        lost = [name for name, of in poses.items() if of and not any(pose is not None for pose in of.values())]
        tests = pool.map(lambda name: _is_mirrored(usable[name], [*poses[name]][:_MIRRORED], reference_map), lost)
        mirrored = frozenset(name for name, found in zip(lost, tests, strict=True) if found)
    return RegisteredSamples(recording.times_s, poses, mirrored)


def _is_mirrored(camera: SampledCamera, numbers: Sequence[int], reference_map: ReferenceMap) -> bool:
    """Whether a sample is registered once left and right are exchanged, as some webcams and telephones do."""
    lens, lit = camera.lens, camera.lit
    if lens is None:
        return False
    registration = ImageRegistration(replace(lens, cx=lens.width - 1.0 - lens.cx), reference_map)
    mask = None if lit is None else np.ascontiguousarray(lit[:, ::-1])
    mirror_images = (np.ascontiguousarray(camera.images[number][:, ::-1]) for number in numbers)
    return any(registration.register(image, mask).world_T_camera is not None for image in mirror_images)
