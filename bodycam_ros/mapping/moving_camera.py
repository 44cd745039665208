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
from bodycam_ros.errors import LensError, MapError
from bodycam_ros.recording.bag_reader import open_recording
from bodycam_ros.recording.camera_video import CameraVideo
from bodycam_ros.recording.video_file import bgr_pixels, grey_pixels

if TYPE_CHECKING:
    from av import VideoFrame

_JPEG_QUALITY = 95
_DIRECTIONS = {0: (0.0, 1.0), 90: (1.0, 0.0), 180: (0.0, -1.0), 270: (-1.0, 0.0)}
"""Direction of the read-out in an upright frame, to the right and down, by its counter-clockwise rotation."""

_JPEG, _PNG = b"\xff\xd8\xff", b"\x89PNG"


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
        duration_s: from the first to the last, about [s].
        readout_s: delay of the right border against the left, and of the lower against the upper [s]; zero if all rows
            are exposed together, or it is unknown.
    """

    name: str
    camera: CameraModel
    count: int
    duration_s: float
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

    Raises:
        RecordingError: no bag that can be read, or no such camera in it.
        LensError: the bag has no camera_info of it, or a malformed one.
    """

    def __init__(self, path: Path, camera: str) -> None:
        self._path, self._camera = path, camera
        with open_recording(path) as recording:
            self.camera = recording.camera_model(camera)
            self.count = recording.image_count(camera)
            self.duration_s = recording.duration_s
            readout = recording.readout(camera)
        self.readout_s = (0.0, 0.0 if readout is None else readout.seconds)
        self.name = f"{path.name}, camera {camera}"

    @contextmanager
    def frames(self) -> Iterator[Iterator[Frame]]:
        """The images in the order in which they were recorded."""
        with open_recording(self._path) as recording:
            yield (_BagFrame(image) for image in recording.images([self._camera]))


@dataclass(frozen=True)
class _VideoFrame:
    """A decoded frame, and the counter-clockwise rotation that makes it upright."""

    seconds: float
    decoded: "VideoFrame"
    rotation_deg: int

    def grey(self) -> NDArray[np.uint8]:
        return np.ascontiguousarray(np.rot90(grey_pixels(self.decoded), self.rotation_deg // 90))

    def file(self) -> tuple[str, bytes]:
        pixels = np.ascontiguousarray(np.rot90(bgr_pixels(self.decoded), self.rotation_deg // 90))
        return ".jpg", cv2.imencode(".jpg", pixels, (cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY))[1].tobytes()


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
        self.duration_s = facts.duration_s
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
    return {camera: BagCamera(bag, camera) for camera in there if cameras is None or camera in cameras}
