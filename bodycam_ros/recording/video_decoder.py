"""The frames of one camera's video in a bag, decoded in their order; each keeps the stamp of its own message."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from fractions import Fraction
from typing import TYPE_CHECKING

import av
import cv2
import numpy as np
from av.error import FFmpegError
from av.filter import Graph
from av.video.codeccontext import VideoCodecContext

from bodycam_ros.camera.camera_image import CameraImage, VideoPacket
from bodycam_ros.errors import RecordingError
from bodycam_ros.own_process import MOST_PIXELS
from bodycam_ros.recording.video_file import DecodedFrame, TimedPacket, bgr_pixels

if TYPE_CHECKING:
    from av import VideoFrame
    from av.video.codeccontext import VideoCodecContext


class VideoDecoder:
    """Takes a camera's packets one after the other, those that nobody looks at included.

    A frame that cannot be decoded is passed on as an error, and so are those after it up to the next keyframe: they
    are made of what is missing.

    Args:
        threads: that may work on one frame.
    """

    def __init__(self, threads: int = 1) -> None:
        self._threads = threads
        self._codec: VideoCodecContext | None = None
        self._number = 0
        self._waiting: dict[int, CameraImage] = {}
        self._damage = "no keyframe has come yet"

    def feed(self, image: CameraImage) -> list[CameraImage]:
        """Decode the next image; return what is ready, in order: nothing, this one, or earlier ones.

        Images that are no video come back as they are.
        """
        packet = image.content
        if not isinstance(packet, VideoPacket):
            if isinstance(packet, RecordingError):
                self._damage = str(packet)
            return [*self.flush(), image]
        if self._damage and not packet.is_key:
            return [*self.flush(), _refused(image, self._damage)]
        ready = self._prepared(packet.codec) if packet.is_key else []
        self._number += 1
        self._waiting[self._number] = image
        return ready + self._decode(packet)

    def flush(self) -> list[CameraImage]:
        """What is left once there are no more packets, or none for now."""
        if self._codec is None:
            return []
        ready = self._decode(None) if self._waiting else []
        self._codec.flush_buffers()
        lost = [_refused(image, "the decoder gave no frame for it") for image in self._waiting.values()]
        self._waiting.clear()
        return ready + lost

    def _prepared(self, codec: str) -> list[CameraImage]:
        """Be ready for a keyframe: after damage, or where the codec changes, with a decoder that remembers nothing."""
        if self._codec is not None and self._codec.name == codec and not self._damage:
            return []
        # Loaded by the first frame of a video: most recordings hold photographs.
        from av import CodecContext
        from av.video.codeccontext import VideoCodecContext

        ready = self.flush()
        decoder = CodecContext.create(codec, "r")
        assert isinstance(decoder, VideoCodecContext)
        decoder.thread_count = self._threads
        # A hole that is painted over would be tracked.
        decoder.options = {"err_detect": "explode", "max_pixels": str(MOST_PIXELS)}
        self._codec = decoder
        self._damage = ""
        return ready

    def _decode(self, packet: VideoPacket | None) -> list[CameraImage]:
        from av import Packet
        from av.error import FFmpegError

        assert self._codec is not None
        coded = None
        if packet is not None:
            coded = Packet(packet.data)
            coded.pts = coded.dts = self._number
            coded.time_base = Fraction(1)
        try:
            frames = self._codec.decode(coded)
        except (FFmpegError, ValueError) as error:
            self._damage = f"it, or a frame that it is made of, is damaged ({error})"
            lost = [_refused(image, self._damage) for image in self._waiting.values()]
            self._waiting.clear()
            return lost
        return [image for frame in frames for image in self._of_frame(frame)]

    def _of_frame(self, frame: "VideoFrame") -> list[CameraImage]:
        """The image of a frame, behind those that should have come before it and did not."""
        number = self._number if frame.pts is None else frame.pts
        passed = [earlier for earlier in self._waiting if earlier < number]
        images = [_refused(self._waiting.pop(earlier), "the decoder gave no frame for it") for earlier in passed]
        if (image := self._waiting.pop(number, None)) is not None:
            images.append(_refused(image, "it is damaged") if frame.is_corrupt else _decoded(image, frame))
        return images


def decode_last(images: Sequence[CameraImage]) -> CameraImage:
    """The last of some images of one camera; of a video they begin with a keyframe, and the others only lead there."""
    decoder = VideoDecoder()
    ready = [decoded for image in images for decoded in decoder.feed(image)]
    return [*ready, *decoder.flush()][-1]


def _decoded(image: CameraImage, frame: "VideoFrame") -> CameraImage:
    return replace(image, content=DecodedFrame(frame))


def _refused(image: CameraImage, reason: str) -> CameraImage:
    return replace(
        image,
        content=RecordingError(
            f"camera {image.camera}: the video frame of stamp {image.stamp_ns} ns cannot be decoded: {reason}"
        ),
    )


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
