"""Frames of one camera of a bag, or of a video."""

from collections.abc import Collection, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel, camera_from_yaml
from bodycam_ros.camera.camera_image import CameraImage, decode_grey
from bodycam_ros.camera.camera_info import readout_time_from_yaml
from bodycam_ros.errors import LensError, MapError, RecordingError
from bodycam_ros.recording.bag_reader import Recording, open_recording
from bodycam_ros.recording.camera_video import CameraVideo
from bodycam_ros.recording.video_encoder import jpegs
from bodycam_ros.recording.video_file import grey_pixels

if TYPE_CHECKING:
    from av import VideoFrame

_JPEG, _PNG = b"\xff\xd8\xff", b"\x89PNG"
_DIRECTIONS = {0: (0.0, 1.0), 90: (1.0, 0.0), 180: (0.0, -1.0), 270: (-1.0, 0.0)}
"""Direction of the read-out in an upright frame, to the right and down, by its counter-clockwise rotation."""


class Frame(Protocol):
    """One picture of a camera, decoded on request."""

    @property
    def seconds(self) -> float:
        """Stamp by the camera's own clock [s]."""

    def grey(self) -> NDArray[np.uint8]:
        """Grey pixels (H, W).

        Raises:
            RecordingError: it cannot be decoded.
        """

    def file(self) -> tuple[str, bytes]:
        """Suffix (".jpg", ".png") and content of an image file with it; raises as ``grey``."""


class MovingCamera(Protocol):
    """Frames that can be read more than once, the same each time.

    Attributes:
        name: of the video or topic, for messages.
        camera: its lens.
        count: about how many frames there are.
        readout_s: delay of the right border against the left, and of the lower against the upper [s]; zero if all rows
            are exposed together, or it is unknown.
    """

    name: str
    camera: CameraModel
    count: int
    readout_s: tuple[float, float]

    def frames(self) -> AbstractContextManager[Iterator[Frame]]:
        """The frames in order of time, from the first on."""


@dataclass(frozen=True)
class _BagFrame:
    """An image of a bag."""

    image: CameraImage

    @property
    def seconds(self) -> float:
        return 1e-9 * self.image.stamp_ns

    def grey(self) -> NDArray[np.uint8]:
        return decode_grey(self.image)

    def file(self) -> tuple[str, bytes]:
        """A compressed image unchanged, in colour; others encoded in grey."""
        content = self.image.content
        if isinstance(content, bytes) and content.startswith(_JPEG):
            return ".jpg", content
        if isinstance(content, bytes) and content.startswith(_PNG):
            return ".png", content
        return ".png", cv2.imencode(".png", self.grey())[1].tobytes()


class BagCamera:
    """A ``MovingCamera`` that is one camera of a bag.

    Args:
        path: ros2 bag folder or .mcap file.
        topic: of its images, as "/hand/image_raw/compressed", or the camera's name; None: the only camera there is.
        lens_path: camera_info YAML; None: the camera_info of the bag.

    Raises:
        RecordingError: no bag that can be read, or no such camera in it.
        LensError: the bag has no camera_info of it, or a malformed one.
    """

    def __init__(self, path: Path, topic: str | None, lens_path: Path | None) -> None:
        self._path = path
        with open_recording(path) as recording:
            self._camera = _camera_of(recording, topic)
            self.camera = recording.camera_model(self._camera) if lens_path is None else camera_from_yaml(lens_path)
            self.count = recording.image_count(self._camera)
            readout = recording.readout(self._camera)
        self.readout_s = (0.0, 0.0 if readout is None else readout.seconds)
        self.name = f"{path.name}, camera {self._camera}"

    @contextmanager
    def frames(self) -> Iterator[Iterator[Frame]]:
        """The images in the order in which they were recorded."""
        with open_recording(self._path) as recording:
            yield (_BagFrame(image) for image in recording.images([self._camera]))


def _camera_of(recording: Recording, topic: str | None) -> str:
    cameras = recording.cameras
    if topic is None and len(cameras) == 1:
        return cameras[0]
    there = ", ".join(f"/{camera}/image_raw/..." for camera in cameras)
    if topic is None:
        raise RecordingError(
            f"{recording.path}: has {len(cameras)} cameras; give with --topic the one that was carried through "
            f"the place: {there}"
        )
    asked = topic.strip("/")
    for camera in cameras:
        if asked == camera or asked.startswith(f"{camera}/image_raw"):
            return camera
    raise RecordingError(f"{recording.path}: no camera with the images {topic}; there are {there}")


@dataclass(frozen=True)
class _VideoFrame:
    """A decoded frame, and the counter-clockwise rotation that makes it upright."""

    seconds: float
    decoded: "VideoFrame"
    rotation_deg: int

    def grey(self) -> NDArray[np.uint8]:
        return np.ascontiguousarray(np.rot90(grey_pixels(self.decoded), self.rotation_deg // 90))

    def file(self) -> tuple[str, bytes]:
        ((_, jpeg),) = jpegs([(self.seconds, self.decoded)], self.rotation_deg)
        return ".jpg", jpeg


class VideoCamera:
    """A ``MovingCamera`` that is a video file; frames are turned upright, as ``bodycam ingest`` turns them.

    Args:
        path: MP4 or the like.
        lens_path: camera_info YAML of upright frames; None: beside the video, named after it.

    Raises:
        RecordingError: the file is no video that can be read.
        LensError: there is no lens, or it is for another size of image.
    """

    def __init__(self, path: Path, lens_path: Path | None) -> None:
        self._video = CameraVideo.of_files(path.stem, [path])
        facts = self._video.facts
        self._rotation_deg = facts.rotation_deg
        self.name = path.name
        self.count = facts.frames or round(facts.rate_hz * facts.duration_s)
        lens_path = lens_path or path.with_suffix(".yaml")
        self.camera = _lens(path, lens_path)
        readout_s, (right, down) = readout_time_from_yaml(lens_path) or 0.0, _DIRECTIONS[facts.rotation_deg]
        self.readout_s = (right * readout_s, down * readout_s)
        if (self.camera.width, self.camera.height) != (facts.width, facts.height):
            turned = f" (turned by {facts.rotation_deg} deg to be upright)" if facts.rotation_deg else ""
            raise LensError(
                f"{lens_path}: is for {self.camera.width} x {self.camera.height} pixels, "
                f"but {path} has {facts.width} x {facts.height}{turned}; calibrate the camera in the mode that it "
                "recorded in"
            )

    @contextmanager
    def frames(self) -> Iterator[Iterator[Frame]]:
        """The frames that can be decoded, in order of time."""
        yield (_VideoFrame(media_s, frame, self._rotation_deg) for media_s, frame in self._video.frames())


def _lens(video: Path, path: Path) -> CameraModel:
    if not path.exists():
        raise LensError(
            f"there is no lens YAML for {video}; give its path with --camera (camera_info YAML, as ROS "
            f"calibration tools write it), or put it at {path}"
        )
    return camera_from_yaml(path)


def open_body_cameras(
    bag: Path, cameras: Collection[str] | None, required: Collection[str] = ()
) -> dict[str, MovingCamera]:
    """The frames of the body cameras of a bag, by name; of all cameras if None.

    Raises:
        MapError: a camera is not in the bag.
        RecordingError: the bag cannot be read.
        LensError: a camera's intrinsics are malformed.
    """
    with open_recording(bag) as recording:
        there = recording.cameras
    if absent := sorted({*(cameras or ()), *required} - set(there)):
        raise MapError(f"{bag}: has no camera {', '.join(absent)}; there are {', '.join(there)}")
    return {camera: BagCamera(bag, camera, None) for camera in there if cameras is None or camera in cameras}
