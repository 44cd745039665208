"""One image of one camera, decoded only where it is looked at."""

from dataclasses import dataclass
from typing import Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera.file_picture import file_values
from bodycam_ros.camera.video_packet import VideoPacket
from bodycam_ros.errors import RecordingError


class Picture(Protocol):
    """A picture that is decoded, but whose pixels are not made yet."""

    def grey(self) -> NDArray[np.uint8]:
        """Grey pixels (H, W)."""

    def colour(self) -> NDArray[np.uint8]:
        """Pixels (H, W, 3): blue, green, red."""


@dataclass(frozen=True)
class CameraImage:
    """An image as it came.

    Attributes:
        camera: the camera's name.
        stamp_ns: mid-exposure of the middle row [ns].
        content: the file's bytes (JPEG or PNG), the grey pixels (H, W) uint8 of a raw image, a picture in another
            encoding, raw or in a file, a video's frame, decoded or still a packet, or the error that says why there is
            none.
    """

    camera: str
    stamp_ns: int
    content: bytes | NDArray[np.uint8] | Picture | VideoPacket | RecordingError


def decode_grey(image: CameraImage) -> NDArray[np.uint8]:
    """Grey pixels (H, W) uint8.

    Raises:
        RecordingError: the bytes are no image that OpenCV can decode, the message was malformed, or it is a video's
            packet, which only a ``VideoDecoder`` that saw those before it can decode.
    """
    content = _decodable(image)
    if isinstance(content, np.ndarray):
        return content
    return _file_pixels(image, content, cv2.IMREAD_GRAYSCALE) if isinstance(content, bytes) else content.grey()


def decode_colour(image: CameraImage) -> NDArray[np.uint8]:
    """Pixels (H, W, 3) uint8: blue, green, red, row by row, the caller's own; three times the same of a grey image.

    Raises:
        RecordingError: as of ``decode_grey``.
    """
    content = _decodable(image)
    if isinstance(content, np.ndarray):
        return np.asarray(cv2.cvtColor(content, cv2.COLOR_GRAY2BGR), dtype=np.uint8)
    return _file_pixels(image, content, cv2.IMREAD_COLOR) if isinstance(content, bytes) else content.colour()


def _decodable(image: CameraImage) -> bytes | NDArray[np.uint8] | Picture:
    """An image's content, if it can be decoded by itself."""
    if isinstance(image.content, RecordingError):
        raise image.content
    if isinstance(image.content, VideoPacket):
        raise RecordingError(f"camera {image.camera}: a video's packet is no picture without those before it")
    return image.content


def _file_pixels(image: CameraImage, file: bytes, mode: int) -> NDArray[np.uint8]:
    return np.asarray(file_values(image.camera, image.stamp_ns, file, mode), dtype=np.uint8)
