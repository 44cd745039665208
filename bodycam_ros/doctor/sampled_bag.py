"""Samples of a bag: the stamps of all images, which is quick, and the images of some instants."""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.camera_image import CameraImage, decode_grey
from bodycam_ros.camera.video_packet import VideoPacket
from bodycam_ros.doctor.sampled_recording import Grey, Instants, SampledCamera, SampledRecording
from bodycam_ros.errors import LensError, RecordingError
from bodycam_ros.geometry import Array
from bodycam_ros.recording.bag_reader import Recording, open_recording
from bodycam_ros.video.video_decoder import decode_last

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
