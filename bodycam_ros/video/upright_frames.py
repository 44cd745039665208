"""Frames as a bag holds them: upright, and compressed so that each needs none that comes after it."""

from collections.abc import Iterable, Iterator
from fractions import Fraction

import av
import cv2
import numpy as np
from av.error import FFmpegError
from av.filter import Graph
from av.video.codeccontext import VideoCodecContext

from bodycam_ros.camera.video_packet import VideoPacket
from bodycam_ros.errors import RecordingError
from bodycam_ros.video.video_file import TimedPacket
from bodycam_ros.video.video_frame import bgr_pixels

_TURNS = {
    90: (("transpose", "cclock"),),
    180: (("hflip", None), ("vflip", None)),
    270: (("transpose", "clock"),),
}
"""FFmpeg's filters that turn a frame counter-clockwise."""

_TICKS_HZ = 1_000_000
_ENCODING = {"preset": "ultrafast", "tune": "zerolatency", "crf": "12"}
"""What it loses is less than a camera's noise; slower presets make files two thirds as large, in three times the time,
and take twice as long to decode."""

_JPEG_QUALITY = 95


def h264_packets(
    frames: Iterable[tuple[float, av.VideoFrame]], rotation_deg: int, rate_hz: float, threads: int
) -> Iterator[TimedPacket]:
    """Compress frames anew as H.264 without B-frames, with a keyframe a second.

    Args:
        frames: presentation time [s] and frame, in the order shown.
        rotation_deg: counter-clockwise by which to turn them: 0, 90, 180 or 270.
        rate_hz: about as many there are in a second.
        threads: that compress.

    Raises:
        RecordingError: frames of a size that H.264 does not have.
    """
    turn = _Turn(rotation_deg)
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
            frame.pict_type = 0  # what the camera had chosen is not to be repeated
            time_of[frame.pts] = media_s
            yield from _timed(encoder.encode(frame), time_of)
        if encoder is not None:
            yield from _timed(encoder.encode(None), time_of)
    except (FFmpegError, ValueError) as error:
        raise RecordingError(f"the frames cannot be compressed as H.264: {error}") from error


def jpegs(frames: Iterable[tuple[float, av.VideoFrame]], rotation_deg: int) -> Iterator[tuple[float, bytes]]:
    """Compress frames as JPEG, turned counter-clockwise: presentation time [s] and file.

    Raises:
        RecordingError: frames of a pixel format that cannot be converted.
    """
    for media_s, frame in frames:
        pixels = np.ascontiguousarray(np.rot90(bgr_pixels(frame), rotation_deg // 90))
        yield media_s, cv2.imencode(".jpg", pixels, (cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY))[1].tobytes()


class _Turn:
    """Turns frames; the filter is made for the first of them."""

    def __init__(self, rotation_deg: int) -> None:
        self._filters = _TURNS.get(rotation_deg)
        self._graph: Graph | None = None

    def __call__(self, frame: av.VideoFrame) -> av.VideoFrame:
        if self._filters is None:
            return frame
        if self._graph is None:
            self._graph = Graph()
            source = self._graph.add_buffer(
                width=frame.width, height=frame.height, format=frame.format, time_base=Fraction(1, _TICKS_HZ)
            )
            turns = [self._graph.add(*turn) for turn in self._filters]
            self._graph.link_nodes(source, *turns, self._graph.add("buffersink")).configure()
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
    encoder.options = dict(_ENCODING)
    return encoder


def _timed(packets: "Iterable[av.Packet[av.VideoStream]]", time_of: dict[int, float]) -> Iterator[TimedPacket]:
    for packet in packets:
        if packet.pts is not None:
            yield TimedPacket(time_of.pop(packet.pts), VideoPacket("h264", bytes(packet)))
