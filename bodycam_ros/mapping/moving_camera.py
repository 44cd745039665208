"""Frames of one camera of a bag, or of a video."""

from collections.abc import Callable, Collection, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from pathlib import Path

import cv2

from bodycam_ros.camera import CameraModel, camera_from_yaml
from bodycam_ros.camera.camera_image import CameraImage, decode_colour, decode_grey
from bodycam_ros.camera.camera_info import readout_time_from_yaml
from bodycam_ros.errors import LensError, MapError
from bodycam_ros.files.shown import other_than
from bodycam_ros.recording.bag_reader import Recording, open_recording
from bodycam_ros.recording.camera_video import CameraVideo
from bodycam_ros.recording.video_file import DecodedFrame

_JPEG_QUALITY = 95
_DIRECTIONS = {0: (0.0, 1.0), 90: (1.0, 0.0), 180: (0.0, -1.0), 270: (-1.0, 0.0)}
"""Direction of the read-out in an upright frame, to the right and down, by its counter-clockwise rotation."""

_JPEG, _PNG = b"\xff\xd8\xff", b"\x89PNG"


@dataclass(frozen=True)
class MovingCamera:
    """Frames that can be read more than once, the same each time.

    Attributes:
        name: of the video or topic, for messages.
        camera: its lens.
        count: about how many frames there are.
        duration_s: from the first to the last, about [s].
        readout_s: delay of the right border against the left, and of the lower against the upper [s]; zero if all rows
            are exposed together, or it is unknown.
        frames: opens the upright images, in order of time, from the first on.
    """

    name: str
    camera: CameraModel
    count: int
    duration_s: float
    readout_s: tuple[float, float]
    frames: Callable[[], AbstractContextManager[Iterator[CameraImage]]]


def picture_file(image: CameraImage) -> tuple[str, bytes]:
    """Suffix (".jpg", ".png") and content of an image file: a compressed image unchanged, a raw one in grey.

    Raises:
        RecordingError: it cannot be decoded.
    """
    content = image.content
    if isinstance(content, bytes) and content.startswith((_JPEG, _PNG)):
        return ".jpg" if content.startswith(_JPEG) else ".png", content
    if isinstance(content, DecodedFrame):
        quality = (cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY)
        return ".jpg", cv2.imencode(".jpg", decode_colour(image), quality)[1].tobytes()
    return ".png", cv2.imencode(".png", decode_grey(image))[1].tobytes()


def video_camera(path: Path, lens_path: Path | None) -> MovingCamera:
    """A video file; frames are turned upright, as ``bodycam ingest`` turns them.

    Args:
        path: MP4 or the like.
        lens_path: camera_info YAML of upright frames; None: beside the video, named after it.

    Raises:
        RecordingError: the file is no video that can be read.
        LensError: there is no lens, or it is for another size of image.
    """
    video = CameraVideo.of_files(path.stem, [path])
    facts = video.facts
    lens_path = lens_path or path.with_suffix(".yaml")
    if not lens_path.exists():
        raise LensError(
            f"there is no lens YAML for {path}; give its path with --camera (camera_info YAML, as ROS "
            f"calibration tools write it), or put it at {lens_path}"
        )
    camera = camera_from_yaml(lens_path)
    facts.check_size(path, camera, lens_path)
    readout_s, (right, down) = readout_time_from_yaml(lens_path) or 0.0, _DIRECTIONS[facts.rotation_deg]

    @contextmanager
    def frames() -> Iterator[Iterator[CameraImage]]:
        yield (
            CameraImage(path.name, round(1e9 * media_s), DecodedFrame(frame, facts.rotation_deg))
            for media_s, frame in video.frames()
        )

    return MovingCamera(
        path.name, camera, facts.about_frames, facts.duration_s, (right * readout_s, down * readout_s), frames
    )


def open_body_cameras(
    bag: Path, cameras: Collection[str] | None, required: Collection[str] = ()
) -> dict[str, MovingCamera]:
    """The frames of the body cameras of a bag, by name, as they were recorded; of all cameras if None.

    Raises:
        MapError: a camera is not in the bag.
        RecordingError: the bag cannot be read.
        LensError: the bag has no camera_info of a camera, or a malformed one.
    """
    with open_recording(bag) as recording:
        if absent := sorted({*(cameras or ()), *required} - set(recording.cameras)):
            raise MapError(f"{bag}: has no camera {absent[0]}; {other_than(absent[0], recording.cameras)}")
        chosen = [camera for camera in recording.cameras if cameras is None or camera in cameras]
        return {camera: _bag_camera(recording, camera) for camera in chosen}


def _bag_camera(recording: Recording, camera: str) -> MovingCamera:
    path, readout = recording.path, recording.readout(camera)

    @contextmanager
    def frames() -> Iterator[Iterator[CameraImage]]:
        with open_recording(path) as opened:
            yield opened.images([camera])

    return MovingCamera(
        f"{path.name}, camera {camera}",
        recording.camera_model(camera),
        recording.image_count(camera),
        recording.duration_s,
        (0.0, 0.0 if readout is None else readout.seconds),
        frames,
    )
