"""The frames of one camera's video in a bag, decoded in their order; each keeps the stamp of its own message."""

from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction
from typing import TYPE_CHECKING

from bodycam_ros.camera.camera_image import CameraImage, VideoPacket
from bodycam_ros.errors import RecordingError
from bodycam_ros.files.bounded_inputs import MOST_PIXELS

if TYPE_CHECKING:
    from av import VideoFrame
    from av.video.codeccontext import VideoCodecContext


class VideoDecoder:
    """Takes a camera's packets one after the other, those included that are not used.

    A frame that cannot be decoded is passed on as an error, and so are those after it up to the next keyframe: they
    are made of what is missing.
    """

    def __init__(self) -> None:
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
        # Loaded by the first frame of a video: most recordings have still images.
        from av import CodecContext
        from av.video.codeccontext import VideoCodecContext

        ready = self.flush()
        decoder = CodecContext.create(codec, "r")
        assert isinstance(decoder, VideoCodecContext)
        decoder.thread_count = 1  # cameras are decoded side by side
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
    from bodycam_ros.recording.video_file import DecodedFrame  # it loads PyAV

    return replace(image, content=DecodedFrame(frame))


def _refused(image: CameraImage, reason: str) -> CameraImage:
    return replace(
        image,
        content=RecordingError(
            f"the video frame of stamp {image.stamp_ns} ns cannot be decoded: {reason}", image.camera
        ),
    )
