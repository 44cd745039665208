"""The messages of a bag that are played: all but videos as they are."""

from collections.abc import Callable, Iterator, Mapping

from bodycam_ros.camera.camera_image import CameraImage, decode_grey
from bodycam_ros.camera.model import optical_frame
from bodycam_ros.errors import RecordingError
from bodycam_ros.messages.factory import Message, header_message
from bodycam_ros.messages.images import COMPRESSED_VIDEO, INFO, TRANSPORTS, compressed_video
from bodycam_ros.messages.imu import IMU_TOPIC
from bodycam_ros.messages.timing import TIMING
from bodycam_ros.recording.typestore import recorded_messages, recording_typestore
from bodycam_ros.recording.video_decoder import VideoDecoder

LATCHED = (INFO, TIMING)
"""Topics of which those that come later still get the latest messages."""

IMAGES = tuple(transport.ending for transport in TRANSPORTS.values())
_RAW = TRANSPORTS["raw"].kind


def camera_of(topic: str) -> str:
    """Name of the camera that a topic belongs to; empty if it belongs to none."""
    for ending in (*LATCHED, IMU_TOPIC, *IMAGES):
        if topic.endswith(ending):
            return topic.removesuffix(ending).removeprefix("/")
    return ""


class PlayedVideo:
    """Turns a bag's messages into those that are played.

    If foxglove_msgs is installed a video is played as it is. Otherwise its frames are played as grey images on
    ``/<camera>/image_raw``, exactly as a replay decodes them, unless the bag has the camera's images in another form.

    Args:
        types: topic -> type in the bag.
        on_undecodable: called with the reason for each frame that cannot be decoded.
        frame_prefix: prefix of the cameras' frames.
        plays_video: whether ROS has the message type of videos.

    Attributes:
        played: topic -> type of what is played.
        sources: topics of the bag that it is made of.
    """

    def __init__(
        self,
        types: Mapping[str, str],
        on_undecodable: Callable[[str], object],
        frame_prefix: str = "",
        plays_video: bool = False,
    ) -> None:
        self._types, self._frame_prefix, self._on_undecodable = types, frame_prefix, on_undecodable
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

    def restart(self) -> None:
        """Play the bag from its start."""
        self._decoders = {camera: VideoDecoder() for camera in self._decoded.values()}

    def serialized(self, topic: str, message: Message) -> Iterator[tuple[str, bytes]]:
        """Topic and CDR of what is played for a message of the bag."""
        if (camera := self._decoded.get(topic)) is None:
            # A video has its frame without a header.
            framed = message if self._types[topic] == COMPRESSED_VIDEO else message.header
            framed.frame_id = f"{self._frame_prefix}{framed.frame_id}"
            yield topic, bytes(recording_typestore().serialize_cdr(message, self._types[topic]))
            return
        try:
            ready = self._decoders[camera].feed(compressed_video(message, camera))
        except RecordingError as error:
            self._on_undecodable(str(error))
            return
        yield from self._raw(ready)

    def rest(self) -> Iterator[tuple[str, bytes]]:
        """Frames that the decoders still have at the end of the bag."""
        for decoder in self._decoders.values():
            yield from self._raw(decoder.flush())

    def _raw(self, images: list[CameraImage]) -> Iterator[tuple[str, bytes]]:
        make = recorded_messages()
        for image in images:
            try:
                grey = decode_grey(image)
            except RecordingError as error:
                self._on_undecodable(str(error))
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
