"""The pixels of a decoded frame."""

from typing import TYPE_CHECKING

import cv2
import numpy as np
from numpy.typing import NDArray

from bodycam_ros.errors import RecordingError

if TYPE_CHECKING:
    from av import VideoFrame

_LUMA_FIRST = {f"yuv{full}{layout}p" for full in ("", "j") for layout in ("420", "422", "444")} | {"nv12", "gray"}
"""Pixel formats with 8 bits whose first plane is the light, row by row."""

_FULL_RANGE = 2
_BLACK, _WHITE = 16, 235  # of a video that leaves head and foot room, as nearly all do
_WITHOUT_ROOM = np.clip(np.round((np.arange(256.0) - _BLACK) * (255.0 / (_WHITE - _BLACK))), 0, 255).astype(np.uint8)


class DecodedFrame:
    """A frame whose pixels are made only for who wants them.

    Args:
        frame: as the decoder gave it.
    """

    def __init__(self, frame: "VideoFrame") -> None:
        self._frame = frame

    def grey(self) -> NDArray[np.uint8]:
        """Grey pixels (H, W), black 0 and white 255.

        Raises:
            RecordingError: a pixel format that cannot be converted.
        """
        return grey_pixels(self._frame)

    def colour(self) -> NDArray[np.uint8]:
        """Pixels (H, W, 3): blue, green, red.

        Raises:
            RecordingError: a pixel format that cannot be converted.
        """
        pixels = bgr_pixels(self._frame)
        if pixels.ndim == 2:
            return np.asarray(cv2.cvtColor(pixels, cv2.COLOR_GRAY2BGR), dtype=np.uint8)
        return np.ascontiguousarray(pixels)


def grey_pixels(frame: "VideoFrame") -> NDArray[np.uint8]:
    """Grey pixels (H, W) of a frame, black 0 and white 255: its luma, without a detour over colours.

    Raises:
        RecordingError: a pixel format that cannot be converted.
    """
    from av.error import FFmpegError

    name = frame.format.name
    try:
        if name not in _LUMA_FIRST:
            return np.asarray(frame.to_ndarray(format="gray"), dtype=np.uint8)
        plane = frame.planes[0]
        rows = np.frombuffer(memoryview(plane), dtype=np.uint8).reshape(-1, plane.line_size)[
            : frame.height, : frame.width
        ]
    except (FFmpegError, ValueError) as error:
        raise RecordingError(
            f"a video frame of the pixel format {name} cannot be converted to grey: {error}"
        ) from error
    is_full = name.startswith("yuvj") or name == "gray" or frame.color_range == _FULL_RANGE
    return np.ascontiguousarray(rows) if is_full else np.asarray(cv2.LUT(rows, _WITHOUT_ROOM), dtype=np.uint8)


def bgr_pixels(frame: "VideoFrame") -> NDArray[np.uint8]:
    """Pixels (H, W, 3) of a frame in OpenCV's order; grey pixels (H, W) of one that has no colours.

    Raises:
        RecordingError: a pixel format that cannot be converted.
    """
    from av.error import FFmpegError

    if frame.format.name.startswith("gray"):
        return grey_pixels(frame)
    try:
        return np.asarray(frame.to_ndarray(format="bgr24"), dtype=np.uint8)
    except (FFmpegError, ValueError) as error:
        raise RecordingError(f"a video frame of the format {frame.format.name} cannot be converted: {error}") from error
