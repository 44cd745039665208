"""One file of a camera, such as an MP4: its frames with their own times, and its sound."""

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import av
import cv2
import numpy as np
from av.container import InputContainer
from av.error import FFmpegError
from av.stream import Discard, Stream
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.camera_image import VideoPacket
from bodycam_ros.errors import LensError, RecordingError
from bodycam_ros.files.bounded_inputs import MOST_PIXELS

SUFFIXES = frozenset({".mp4", ".mov", ".m4v", ".mkv"})
"""Endings of files that are taken for videos in a folder; a file that is named may have any."""

_BITSTREAM_FILTERS = {"h264": "h264_mp4toannexb", "hevc": "hevc_mp4toannexb"}
_FORMATS = "mov,matroska,avi,mpegts,mpeg,h264,hevc"
"""Formats that are tried, whatever a file's name: FFmpeg also reads lists of other files, and of addresses."""

_LOOKED_AT = 150
"""Packets whose order shows whether the stream has B-frames: encoders that make them make them all along."""


@dataclass(frozen=True)
class FileFacts:
    """What a file's header has, and what its first frames show.

    Attributes:
        codec: of the video, as FFmpeg names it.
        width, height: of a frame as it is to be shown, after the rotation [px].
        duration_s: from media time 0 to the end of the last frame, by the file's index [s].
        frames: that the index lists; 0 if it does not.
        rate_hz: frames per second on average.
        rotation_deg: counter-clockwise by which a frame has to be turned to be upright: 0, 90, 180 or 270.
        has_b_frames: whether frames are stored in another order than they are shown.
        has_sound: whether there is sound.
        created: when the recording began by the camera's clock; None if the file does not have it.
    """

    codec: str
    width: int
    height: int
    duration_s: float
    frames: int
    rate_hz: float
    rotation_deg: int = 0
    has_b_frames: bool = False
    has_sound: bool = False
    created: datetime | None = None

    @property
    def about_frames(self) -> int:
        """Frames by the index, or by rate and duration."""
        return self.frames or round(self.rate_hz * self.duration_s)

    def check_size(self, path: Path, lens: CameraModel, lens_path: Path) -> None:
        """Refuse a lens that is for frames of another size.

        Raises:
            LensError: it is; the message names both files and what to do.
        """
        if (lens.width, lens.height) != (self.width, self.height):
            turned = f" (turned by {self.rotation_deg} deg to be upright)" if self.rotation_deg else ""
            raise LensError(
                f"{lens_path}: is for {lens.width} x {lens.height} pixels, but {path} has {self.width} x "
                f"{self.height}{turned}; calibrate the camera in the mode that it recorded in"
            )

    @property
    def is_upright_annex_b(self) -> bool:
        """Whether packets can go into a bag as they are: H.264 or HEVC, in the order shown, not to be turned."""
        return self.codec in _BITSTREAM_FILTERS and not self.has_b_frames and self.rotation_deg == 0


TimedPacket = tuple[float, VideoPacket]
"""Presentation time in its file [s], and a frame that is still compressed."""


def read_facts(path: Path) -> FileFacts:
    """Look at a file: its header and its first frames.

    Raises:
        RecordingError: it is no video, or none that can be read; the message names it and what to do.
    """
    with opened(path) as container:
        stream = _video_stream(container, path)
        context = stream.codec_context
        times, rotation = [], None
        for packet in container.demux(stream):
            if packet.pts is not None:
                times.append(packet.pts)
            if rotation is None:
                rotation = _rotation(packet)
            if len(times) == _LOOKED_AT:
                break
        if rotation is None:
            raise RecordingError(f"{path}: none of its frames can be decoded; copy it again from the camera")
        width, height = context.width, context.height
        if rotation in (90, 270):
            width, height = height, width
        return FileFacts(
            codec=context.name,
            width=width,
            height=height,
            rotation_deg=rotation,
            has_b_frames=any(later <= earlier for earlier, later in zip(times, times[1:], strict=False)),
            duration_s=_duration_s(container, stream),
            frames=stream.frames,
            rate_hz=float(stream.average_rate or 0),
            has_sound=bool(container.streams.audio),
            created=_created(container.metadata | stream.metadata),
        )


@contextmanager
def opened(path: Path) -> Iterator[InputContainer]:
    """A file as PyAV's container; errors of FFmpeg in the block become errors for the user.

    Raises:
        RecordingError: it is no video, is cut off, or damaged.
    """
    try:
        if not path.is_file():
            raise RecordingError(f"{path}: is no file" if path.exists() else f"{path}: does not exist")
        # Absolute: what stands before a colon would be a protocol.
        with av.open(
            os.path.abspath(path),
            "r",
            metadata_errors="replace",
            container_options={"format_whitelist": _FORMATS, "protocol_whitelist": "file"},
        ) as container:
            yield container
    except (FFmpegError, ValueError) as error:
        raise RecordingError(f"{path}: {_fault(path, error)}") from error
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read: {error.strerror or error}") from error


def packets(path: Path) -> Iterator[TimedPacket]:
    """The frames of an H.264 or HEVC stream in the order stored: presentation time [s] and packet of Annex B.

    A file that is cut off ends where it does.

    Raises:
        RecordingError: the file cannot be opened.
    """
    with opened(path) as container:
        stream = _video_stream(container, path)
        codec = stream.codec_context.name
        to_annex_b = av.BitStreamFilterContext(_BITSTREAM_FILTERS[codec], stream)
        for packet in demuxed(container, stream):
            if packet.pts is None or packet.is_corrupt:
                continue
            media_s = float(packet.pts * (stream.time_base or 0))
            for filtered in to_annex_b.filter(packet):
                yield media_s, VideoPacket(codec, bytes(filtered))


def frames(path: Path, threads: int = 0) -> Iterator[tuple[float, av.VideoFrame]]:
    """The frames of a file in the order shown: presentation time [s] and frame, not turned.

    Frames that cannot be decoded are left out.

    Args:
        path: the file.
        threads: that decode; 0 for all cores.

    Raises:
        RecordingError: the file cannot be opened.
    """
    with opened(path) as container:
        stream = _video_stream(container, path)
        stream.codec_context.thread_count = threads
        stream.thread_type = "AUTO"
        for packet in demuxed(container, stream):
            try:
                decoded = packet.decode()
            except (FFmpegError, ValueError):
                continue
            for frame in decoded:
                if frame.pts is not None and not frame.is_corrupt:
                    yield float(frame.pts * (frame.time_base or 0)), frame


def frame_index(path: Path) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """(N,) presentation times [s] of a file's frames in the order stored, and (N,) which are keyframes.

    Nothing is decoded.

    Raises:
        RecordingError: the file cannot be opened.
    """
    with opened(path) as container:
        stream = _video_stream(container, path)
        unit_s = float(stream.time_base or 0)
        found = [(p.pts, p.is_keyframe) for p in demuxed(container, stream) if p.pts is not None and not p.is_corrupt]
        return unit_s * np.array([pts for pts, _ in found], np.float64), np.array([key for _, key in found], bool)


def keyframe_near(path: Path, media_s: float) -> tuple[float, av.VideoFrame] | None:
    """The last keyframe before a time, which needs no other to be decoded, and its own [s]; None if it is damaged.

    Raises:
        RecordingError: the file cannot be opened.
    """
    with opened(path) as container:
        stream = _video_stream(container, path)
        container.seek(round(media_s / float(stream.time_base or 1)), stream=stream)
        stream.codec_context.skip_frame = "NONKEY"
        for packet in demuxed(container, stream):
            for frame in packet.decode():
                return None if frame.is_corrupt else (float((frame.pts or 0) * (frame.time_base or 0)), frame)
    return None


def demuxed(container: InputContainer, *streams: Stream) -> Iterator[Any]:
    """The packets of some streams up to their end, or to where the file breaks off; the last are empty.

    The others are not read: of two hours, sound is a hundredth of all.
    """
    for other in container.streams:
        other.discard = Discard.default if other in streams else Discard.all
    with suppress(FFmpegError, ValueError):
        yield from container.demux(*streams)


def _video_stream(container: InputContainer, path: Path) -> "av.VideoStream":
    for stream in container.streams.video:
        context = stream.codec_context
        if context is not None and context.width:
            if context.width * context.height > MOST_PIXELS:
                raise RecordingError(f"{path}: is not decoded: {context.width} x {context.height} pixels a frame")
            # They may grow on the way.
            context.options = {"max_pixels": str(MOST_PIXELS)}
            return stream
    raise RecordingError(
        f"{path}: has no video that can be decoded: it is sound alone, or cut off or damaged; copy it again from the "
        "camera"
    )


def _duration_s(container: InputContainer, stream: "av.VideoStream") -> float:
    """From media time 0 to the end of the video; some files have it for all their streams together only."""
    if stream.duration is None:
        return (container.duration or 0) / av.time_base
    return float((stream.duration + max(0, stream.start_time or 0)) * (stream.time_base or 0))


def _rotation(packet: "av.Packet[av.VideoStream]") -> int | None:
    """Angle by which the first frame is turned; None if the packet gives none."""
    try:
        for frame in packet.decode():
            return round(frame.rotation / 90) * 90 % 360
    except (FFmpegError, ValueError):
        pass
    return None


def _created(metadata: dict[str, str]) -> datetime | None:
    try:
        created = datetime.fromisoformat(metadata.get("creation_time", ""))
    except ValueError:
        return None
    return created if created.tzinfo else created.replace(tzinfo=UTC)


def _fault(path: Path, error: Exception) -> str:
    """What is wrong with a file that FFmpeg does not open."""
    try:
        with path.open("rb") as file:
            start = file.read(64)
    except OSError as unreadable:
        return f"cannot be read: {unreadable.strerror or unreadable}"
    if not start:
        return "is empty"
    if start[4:8] in (b"ftyp", b"moov", b"mdat", b"free", b"wide"):
        return (
            "is a cut-off MP4: its index, which cameras write last, is not there, as when the battery died or a copy "
            "broke off; copy it again, or let the camera or a recovery program repair it"
        )
    reason = getattr(error, "strerror", None) or error
    return f"is not a video that can be read ({reason}); expected an MP4 with H.264 or HEVC, as cameras write it"


_LUMA_FIRST = {f"yuv{full}{layout}p" for full in ("", "j") for layout in ("420", "422", "444")} | {"nv12", "gray"}
"""Pixel formats with 8 bits whose first plane is the light, row by row."""

_FULL_RANGE = 2
_BLACK, _WHITE = 16, 235  # of a video that leaves head and foot room, as nearly all do
_GAIN = 255.0 / (_WHITE - _BLACK)


class DecodedFrame:
    """A frame whose pixels are made only for who wants them.

    Args:
        frame: as the decoder gave it.
        rotation_deg: counter-clockwise by which the pixels are turned: 0, 90, 180 or 270.
    """

    def __init__(self, frame: av.VideoFrame, rotation_deg: int = 0) -> None:
        self._frame, self._turns = frame, rotation_deg // 90

    def grey(self) -> NDArray[np.uint8]:
        """Grey pixels (H, W), black 0 and white 255: the luma, without a detour over colours.

        Raises:
            RecordingError: a pixel format that cannot be converted.
        """
        frame, name = self._frame, self._frame.format.name
        if name not in _LUMA_FIRST:
            return self._converted("gray")
        plane = frame.planes[0]
        grey = np.frombuffer(memoryview(plane), np.uint8).reshape(-1, plane.line_size)[: frame.height, : frame.width]
        if not (name.startswith("yuvj") or name == "gray" or frame.color_range == _FULL_RANGE):
            # Rounded and cut off at 0 and 255, in a third of the time of a table of values.
            grey = np.asarray(cv2.addWeighted(grey, _GAIN, grey, 0.0, -_BLACK * _GAIN), np.uint8)
        return np.ascontiguousarray(np.rot90(grey, self._turns))

    def colour(self) -> NDArray[np.uint8]:
        """Pixels (H, W, 3): blue, green, red; raises as ``grey`` does."""
        return self._converted("bgr24")

    def _converted(self, wanted: str) -> NDArray[np.uint8]:
        try:
            pixels = np.asarray(self._frame.to_ndarray(format=wanted), np.uint8)
        except (FFmpegError, ValueError) as error:
            raise RecordingError(
                f"a video frame of the pixel format {self._frame.format.name} cannot be converted: {error}"
            ) from error
        return np.ascontiguousarray(np.rot90(pixels, self._turns))
