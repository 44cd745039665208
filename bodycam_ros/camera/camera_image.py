"""One image of one camera, decoded only where it is looked at."""

from dataclasses import dataclass
from typing import Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera.video_packet import VideoPacket
from bodycam_ros.errors import RecordingError


class Picture(Protocol):
    """A picture that is decoded, but whose pixels are not made yet."""

    def grey(self) -> NDArray[np.uint8]:
        """Grey pixels (H, W)."""


@dataclass(frozen=True)
class CameraImage:
    """An image as it came.

    Attributes:
        camera: the camera's name.
        stamp_ns: mid-exposure of the middle row [ns].
        content: the file's bytes (JPEG or PNG), the grey pixels (H, W) uint8 of a raw image, a video's frame, decoded
            or still a packet, or the error that says why there is none.
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
    if isinstance(image.content, RecordingError):
        raise image.content
    if isinstance(image.content, np.ndarray):
        return image.content
    if isinstance(image.content, VideoPacket):
        raise RecordingError(f"camera {image.camera}: a video's packet is no picture without those before it")
    if not isinstance(image.content, bytes):
        return image.content.grey()
    encoded = np.frombuffer(image.content, dtype=np.uint8)
    try:
        grey = cv2.imdecode(encoded, cv2.IMREAD_GRAYSCALE) if encoded.size else None
    except cv2.error:  # a header that claims an absurd size
        grey = None
    if grey is None:
        raise RecordingError(
            f"camera {image.camera}: the image of stamp {image.stamp_ns} ns ({len(image.content)} bytes) "
            "cannot be decoded; expected JPEG or PNG"
        )
    return np.asarray(grey, dtype=np.uint8)
