"""The videos of a bag, as the graph can hear them: as they are, or decoded where ROS does not know their type."""

from collections.abc import Callable, Iterator, Mapping

from bodycam_ros.camera.camera_image import CameraImage, decode_grey
from bodycam_ros.errors import RecordingError
from bodycam_ros.messages.factory import Message
from bodycam_ros.messages.header import header_message, optical_frame
from bodycam_ros.messages.images import compressed_video
from bodycam_ros.recording.typestore import COMPRESSED_VIDEO, recorded_messages, recording_typestore
from bodycam_ros.video.video_decoder import VideoDecoder

INFO, TIMING = "/camera_info", "/timing"
IMAGES = ("/image_raw/compressed", "/image_raw", "/image_raw/compressed_video", "/image_raw/foxglove")
_RAW = "sensor_msgs/msg/Image"


def camera_of(topic: str) -> str:
    """Name of the camera that a topic belongs to; empty if it belongs to none."""
    for ending in (INFO, TIMING, *IMAGES):
        if topic.endswith(ending):
            return topic.removesuffix(ending).removeprefix("/")
    return ""


class PlayedVideo:
    """Turns a bag's messages into those that are played.

    Where foxglove_msgs is installed a video is played as it is. Else its frames are played as grey images on
    ``/<camera>/image_raw``, exactly as a replay decodes them; not where the bag has the camera's images in another way.

    Args:
        types: topic -> type in the bag.
        on_refused: told of each frame that cannot be decoded.
        frame_prefix: before the names of the cameras' frames.
        plays_video: whether ROS has the type of videos here.

    Attributes:
        played: topic -> type of what is played.
        sources: the topics of the bag that it is made of.
    """

    def __init__(
        self,
        types: Mapping[str, str],
        on_refused: Callable[[str], object],
        frame_prefix: str = "",
        plays_video: bool = False,
    ) -> None:
        self._types = types
        self._frame_prefix = frame_prefix
        self._on_refused = on_refused
        self._decoders: dict[str, VideoDecoder] = {}
        stills = {
            camera_of(topic) for topic, kind in types.items() if topic.endswith(IMAGES) and kind != COMPRESSED_VIDEO
        }
        self.played: dict[str, str] = {}
        self._decoded: dict[str, str] = {}
        for topic, kind in types.items():
            if kind != COMPRESSED_VIDEO or plays_video:
                self.played[topic] = kind
            elif (camera := camera_of(topic)) not in stills:
                self._decoded[topic] = camera
                self.played[f"/{camera}/image_raw"] = _RAW
        self.sources = [topic for topic in types if topic in self.played or topic in self._decoded]

    def begin(self) -> None:
        """The bag is played from its start."""
        self._decoders = {camera: VideoDecoder() for camera in self._decoded.values()}

    def serialized(self, topic: str, message: Message) -> Iterator[tuple[str, bytes]]:
        """Topic and CDR of what is to be played for a message of the bag."""
        if (camera := self._decoded.get(topic)) is None:
            # A video says of which frame it is without a header.
            framed = message if self._types[topic] == COMPRESSED_VIDEO else message.header
            framed.frame_id = f"{self._frame_prefix}{framed.frame_id}"
            yield topic, bytes(recording_typestore().serialize_cdr(message, self._types[topic]))
            return
        try:
            ready = self._decoders[camera].feed(compressed_video(message, camera))
        except RecordingError as error:
            self._on_refused(str(error))
            return
        yield from self._raw(ready)

    def rest(self) -> Iterator[tuple[str, bytes]]:
        """What the decoders still hold when the bag has ended."""
        for decoder in self._decoders.values():
            yield from self._raw(decoder.flush())

    def _raw(self, images: list[CameraImage]) -> Iterator[tuple[str, bytes]]:
        make = recorded_messages()
        for image in images:
            try:
                grey = decode_grey(image)
            except RecordingError as error:
                self._on_refused(str(error))
                continue
            raw = make(
                _RAW,
                header=header_message(make, image.stamp_ns, f"{self._frame_prefix}{optical_frame(image.camera)}"),
                height=grey.shape[0],
                width=grey.shape[1],
                encoding="mono8",
                step=grey.shape[1],
                data=grey.reshape(-1),
            )
            yield f"/{image.camera}/image_raw", bytes(recording_typestore().serialize_cdr(raw, _RAW))
