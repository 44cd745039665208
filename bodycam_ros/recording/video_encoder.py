"""Frames compressed anew: as H.264 packets for a bag, or as a video file."""

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
from av.error import FFmpegError
from av.filter import Graph
from av.video.codeccontext import VideoCodecContext
from numpy.typing import NDArray

from bodycam_ros.camera.camera_image import VideoPacket
from bodycam_ros.errors import OutputError, RecordingError
from bodycam_ros.recording.video_file import TimedPacket

Image = NDArray[np.uint8]

_TURNS = {
    90: (("transpose", "cclock"),),
    180: (("hflip", None), ("vflip", None)),
    270: (("transpose", "clock"),),
}
"""FFmpeg's filters that turn a frame counter-clockwise."""

_TICKS_HZ = 1_000_000
_FILE_TICKS_HZ = 90_000
_BAG_ENCODING = {"preset": "ultrafast", "tune": "zerolatency", "crf": "12"}
"""What it loses is less than a camera's noise; slower presets make files two thirds as large, in three times the time,
and take twice as long to decode."""

_FILE_ENCODING = {"preset": "veryfast", "crf": "20"}
"""Lines of a pixel stay sharp."""


def h264_packets(
    frames: Iterable[tuple[float, av.VideoFrame]],
    rotation_deg: int,
    rate_hz: float,
    threads: int,
    size: tuple[int, int] | None = None,
) -> Iterator[TimedPacket]:
    """Compress frames anew as H.264 without B-frames, with a keyframe a second: presentation time [s] and packet.

    Args:
        frames: presentation time [s] and frame, in the order shown.
        rotation_deg: counter-clockwise by which to turn them: 0, 90, 180 or 270.
        rate_hz: about as many there are in a second.
        threads: that compress.
        size: width and height after the turn [px]; None: as they are.

    Raises:
        RecordingError: frames of a size that H.264 does not have.
    """
    turn = _Turn(rotation_deg, size)
    encoder: VideoCodecContext | None = None
    time_of: dict[int, float] = {}
    try:
        for media_s, shown in frames:
            frame = turn(shown)
            is_full = frame.format.name.startswith("yuvj")
            frame = frame.reformat(format="yuvj420p" if is_full else "yuv420p")
            if encoder is None:
                encoder = _encoder(frame, rate_hz, threads)
            frame.pts, frame.time_base = round(media_s * _TICKS_HZ), Fraction(1, _TICKS_HZ)
            frame.pict_type = 0  # the camera's own choice is not to be repeated
            time_of[frame.pts] = media_s
            yield from _timed(encoder.encode(frame), time_of)
        if encoder is not None:
            yield from _timed(encoder.encode(None), time_of)
    except (FFmpegError, ValueError) as error:
        raise RecordingError(f"the frames cannot be compressed as H.264: {error}") from error


class _Turn:
    """Turns and scales frames; the filter is made for the first of them."""

    def __init__(self, rotation_deg: int, size: tuple[int, int] | None) -> None:
        self._filters = [*_TURNS.get(rotation_deg, ())]
        if size is not None:
            self._filters.append(("scale", f"{size[0]}:{size[1]}:flags=area"))
        self._graph: Graph | None = None

    def __call__(self, frame: av.VideoFrame) -> av.VideoFrame:
        if not self._filters:
            return frame
        if self._graph is None:
            self._graph = Graph()
            source = self._graph.add_buffer(
                width=frame.width, height=frame.height, format=frame.format, time_base=Fraction(1, _TICKS_HZ)
            )
            filters = [self._graph.add(*each) for each in self._filters]
            self._graph.link_nodes(source, *filters, self._graph.add("buffersink")).configure()
        self._graph.vpush(frame)
        return self._graph.vpull()


def _encoder(frame: av.VideoFrame, rate_hz: float, threads: int) -> VideoCodecContext:
    encoder = av.CodecContext.create("libx264", "w")
    assert isinstance(encoder, VideoCodecContext)
    encoder.width, encoder.height = frame.width, frame.height
    encoder.pix_fmt = frame.format.name
    encoder.color_range, encoder.colorspace = frame.color_range, frame.colorspace
    encoder.time_base = Fraction(1, _TICKS_HZ)
    encoder.framerate = Fraction(max(1.0, rate_hz)).limit_denominator(1001)
    encoder.gop_size = max(1, round(rate_hz))
    encoder.max_b_frames = 0
    encoder.thread_count = threads
    encoder.options = dict(_BAG_ENCODING)
    return encoder


def _timed(packets: "Iterable[av.Packet[av.VideoStream]]", time_of: dict[int, float]) -> Iterator[TimedPacket]:
    for packet in packets:
        if packet.pts is not None:
            yield time_of.pop(packet.pts), VideoPacket("h264", bytes(packet))


@contextmanager
def video_writer(path: Path, rate_hz: float) -> Iterator[Callable[[float, Image], None]]:
    """Give a function that appends a picture: its time, from the first on and increasing [s], and its pixels.

    Pixels are (H, W, 3), blue, green, red; a last odd row or column is cut off, as H.264 has none.

    Args:
        path: the file to write; a block that fails leaves a part of it.
        rate_hz: of the pictures, about.

    Raises:
        OutputError: it cannot be written, in the block or at its end.
    """
    rate = Fraction(max(1.0, rate_hz)).limit_denominator(1001)
    streams: list[av.VideoStream] = []
    try:
        with av.open(str(path), "w") as container:

            def add(seconds: float, picture: Image) -> None:
                height, width = 2 * (picture.shape[0] // 2), 2 * (picture.shape[1] // 2)
                if not streams:
                    stream = container.add_stream("libx264", rate=rate, options=dict(_FILE_ENCODING))
                    stream.width = width
                    stream.height = height
                    stream.pix_fmt = "yuv420p"
                    stream.codec_context.time_base = Fraction(1, _FILE_TICKS_HZ)
                    streams.append(stream)
                frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(picture[:height, :width]), format="bgr24")
                frame.pts, frame.time_base = round(seconds * _FILE_TICKS_HZ), Fraction(1, _FILE_TICKS_HZ)
                container.mux(streams[0].encode(frame))

            yield add
            for stream in streams:
                container.mux(stream.encode(None))
    except FFmpegError as error:
        raise OutputError(f"{path}: the video cannot be written: {error}") from error
