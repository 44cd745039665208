"""Pictures as a video that every player shows: H.264 in an MP4, at the times that they are of."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
from av.container import OutputContainer
from av.error import FFmpegError
from numpy.typing import NDArray

from bodycam_ros.errors import OutputError

_TICKS_HZ = 90_000
_ENCODING = {"preset": "veryfast", "crf": "20"}
"""Lines of a pixel stay sharp."""

Image = NDArray[np.uint8]


@contextmanager
def video_writer(path: Path, rate_hz: float) -> Iterator[Callable[[float, Image], None]]:
    """Give a function that appends a picture: when it is of, from the first on and increasing [s], and its pixels.

    Args:
        path: the file to write; a block that fails leaves a part of it.
        rate_hz: of the pictures, about.

    Raises:
        OutputError: it cannot be written, in the block or at its end.
    """
    try:
        with av.open(str(path), "w") as container:
            encoder = _Encoder(container, rate_hz)
            yield encoder.add
            encoder.finish()
    except FFmpegError as error:
        raise OutputError(f"{path}: the video cannot be written: {error}") from error


class _Encoder:
    def __init__(self, container: OutputContainer, rate_hz: float) -> None:
        self._container = container
        self._rate = Fraction(max(1.0, rate_hz)).limit_denominator(1001)
        self._stream: av.VideoStream | None = None

    def add(self, seconds: float, picture: Image) -> None:
        """Append a picture (H, W, 3), blue, green, red; a last odd row or column is cut off, as H.264 has none."""
        height, width = 2 * (picture.shape[0] // 2), 2 * (picture.shape[1] // 2)
        if self._stream is None:
            self._stream = self._begun(width, height)
        frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(picture[:height, :width]), format="bgr24")
        frame.pts, frame.time_base = round(seconds * _TICKS_HZ), Fraction(1, _TICKS_HZ)
        self._container.mux(self._stream.encode(frame))

    def finish(self) -> None:
        """Append what the encoder still holds."""
        if self._stream is not None:
            self._container.mux(self._stream.encode(None))

    def _begun(self, width: int, height: int) -> "av.VideoStream":
        stream = self._container.add_stream("libx264", rate=self._rate, options=dict(_ENCODING))
        stream.width, stream.height, stream.pix_fmt = width, height, "yuv420p"
        stream.codec_context.time_base = Fraction(1, _TICKS_HZ)
        return stream
