"""A bag that is played: what of it, when each message is due, and who has to read it."""

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from heapq import merge
from pathlib import Path

from bodycam_ros.camera.camera_image import CameraImage, decode_grey
from bodycam_ros.camera.model import optical_frame
from bodycam_ros.errors import RecordingError
from bodycam_ros.live.dropped_messages import DroppedMessages
from bodycam_ros.live.node_parameters import PlayerParameters
from bodycam_ros.messages.diagnostics import Status, StatusLevel, few
from bodycam_ros.messages.factory import Message, header_message
from bodycam_ros.messages.images import COMPRESSED_VIDEO, INFO, TRANSPORTS, compressed_video, image_stamp_ns
from bodycam_ros.messages.imu import IMU_TOPIC, IMU_TYPE
from bodycam_ros.messages.timing import TIMING
from bodycam_ros.recording.bag_file import BagFile
from bodycam_ros.recording.bag_reader import sensor_topics
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


class Playback:
    """Plays some cameras of a bag; a context, which closes it.

    Args:
        path: of the bag.
        parameters: of the player.
        frame_prefix: prefix of the cameras' frames.
        plays_video: whether ROS has the message type of videos.
        dropped: counts frames that cannot be decoded.
        warn: takes a line for the user.

    Attributes:
        played: topic -> type of what is played.
        count: messages so far, since the start of the bag.
        behind_s: largest delay of a message [s].

    Raises:
        RecordingError: a bag cannot be read, or has none of the cameras, or of their inertial sensors.
    """

    def __init__(
        self,
        path: Path,
        parameters: PlayerParameters,
        frame_prefix: str,
        plays_video: bool,
        dropped: DroppedMessages,
        warn: Callable[[str], object],
    ) -> None:
        self._parameters, self._dropped = parameters, dropped
        self._files = ExitStack()
        bag = self._files.enter_context(BagFile(path))
        self._start_ns = bag.start_ns
        chosen = _choose_topics(path, bag.topics, parameters.cameras, warn)
        self._sources = {bag: chosen}
        if parameters.imu:
            sensors = self._files.enter_context(BagFile(Path(parameters.imu)))
            own = {camera_of(topic) for topic in chosen if topic.endswith(IMU_TOPIC)}
            self._sources[sensors] = dict.fromkeys(sensor_topics(sensors, {*map(camera_of, chosen)} - own), IMU_TYPE)
        chosen = {topic: kind for topics in self._sources.values() for topic, kind in topics.items()}
        self._video = PlayedVideo(
            chosen, lambda reason: dropped.add("frames dropped", reason), frame_prefix, plays_video
        )
        self.played = self._video.played
        self._started_s: float | None = None
        self.count, self.behind_s = 0, 0.0

    def __enter__(self) -> "Playback":
        return self

    def __exit__(self, *error: object) -> None:
        self._files.close()

    @property
    def now_ns(self) -> int:
        """Time of the recording that is played now [ns]; just before its start until then."""
        if self._started_s is None:
            return self._start_ns - 1
        return self._start_ns + round(1e9 * self._parameters.rate * (time.monotonic() - self._started_s))

    def left_s(self, due_ns: int) -> float:
        """Time until a message is due [s]."""
        return 1e-9 * (due_ns - self.now_ns) / self._parameters.rate

    def messages(self) -> Iterator[tuple[int, str, int, bytes]]:
        """When each message is due [ns], its topic, the stamp of an image [ns], and its CDR; from the bag's start."""
        self.count, self.behind_s, self._started_s = 0, 0.0, time.monotonic()
        self._video.restart()
        recorded_ns = self._start_ns
        recorded = (bag.messages([*({*topics} & {*self._video.sources})]) for bag, topics in self._sources.items())
        for topic, recorded_ns, message in merge(*recorded, key=lambda each: each[1]):
            self.behind_s = max(self.behind_s, -self.left_s(recorded_ns))
            stamp_ns = image_stamp_ns(message) if topic.endswith(IMAGES) else 0
            for played, serialized in self._video.serialized(topic, message):
                self.count += 1
                yield recorded_ns, played, stamp_ns, serialized
        for played, serialized in self._video.rest():
            self.count += 1
            yield recorded_ns, played, 0, serialized

    def lacking(self, wanted: int, count_readers: Callable[[str], int]) -> list[str]:
        """Topics that too few nodes read, with the number of nodes.

        Args:
            wanted: readers of each camera_info; for images one is enough.
            count_readers: number of nodes that read a topic.
        """
        lacking = []
        for camera in dict.fromkeys(map(camera_of, self.played)):
            of_images = [f"/{camera}{ending}" for ending in IMAGES if f"/{camera}{ending}" in self.played]
            # A bag may have them raw and compressed; one of the two is enough.
            if of_images and not any(map(count_readers, of_images)):
                lacking.append(f"{of_images[0]} (no node)")
            info = f"/{camera}{INFO}"
            if camera not in self._parameters.image_only and info in self.played:
                count = count_readers(info)
                lacking += [f"{info} ({count} of {wanted} nodes)"] if count < wanted else []
        return lacking

    def report(self, name: str, text: str, lacking: Sequence[str]) -> Status:
        """Progress."""
        values: dict[str, object] = {
            "messages played": self.count,
            "time [s]": round(1e-9 * self.now_ns, 1),
            "largest delay [s]": round(self.behind_s, 2),
            "readers lacking": few(lacking) or "none",
            **self._dropped.values,
        }
        return Status(name, StatusLevel.WARN if lacking else StatusLevel.OK, text, values)


def _choose_topics(
    path: Path, there: dict[str, str], asked: Sequence[str], warn: Callable[[str], object]
) -> dict[str, str]:
    """Topic -> type of what is played."""
    topics = {topic: kind for topic, kind in there.items() if camera_of(topic)}
    cameras = dict.fromkeys(camera_of(topic) for topic in topics if topic.endswith(IMAGES))
    if not cameras:
        raise RecordingError(f"{path}: no camera to play; expected topics such as /head{IMAGES[0]}")
    if not asked:
        return topics
    if not {*asked} & {*cameras}:
        raise RecordingError(f"{path}: has no images of {', '.join(asked)}; it has {', '.join(cameras)}")
    if lacking := [camera for camera in asked if camera not in cameras]:
        warn(f"{path} has no images of {', '.join(lacking)}")
    return {topic: kind for topic, kind in topics.items() if camera_of(topic) in asked}
