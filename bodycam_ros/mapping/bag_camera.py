"""One camera of a bag, such as one that was carried by hand."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import camera_from_yaml
from bodycam_ros.camera.camera_image import CameraImage, decode_grey
from bodycam_ros.errors import RecordingError
from bodycam_ros.recording.bag_reader import Recording, open_recording

_JPEG, _PNG = b"\xff\xd8\xff", b"\x89PNG"


@dataclass(frozen=True)
class _BagFrame:
    """An image as it is in the bag."""

    image: CameraImage

    @property
    def seconds(self) -> float:
        return 1e-9 * self.image.stamp_ns

    def grey(self) -> NDArray[np.uint8]:
        return decode_grey(self.image)

    def file(self) -> tuple[str, bytes]:
        """A compressed image as it is, colours and all; other pictures as they are looked at, grey."""
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
        lens_path: camera_info YAML; None: what the bag says of the camera.

    Raises:
        RecordingError: no bag that can be read, or no such camera in it.
        LensError: the bag does not know its lens, or what it says is malformed.
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
    def frames(self) -> Iterator[Iterator[_BagFrame]]:
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
            f"{recording.path}: has {len(cameras)} cameras; say with --topic which of them was carried through the "
            f"place: {there}"
        )
    asked = topic.strip("/")
    for camera in cameras:
        if asked == camera or asked.startswith(f"{camera}/image_raw"):
            return camera
    raise RecordingError(f"{recording.path}: no camera with the images {topic}; there are {there}")
