"""A bag that is played: what of it, when each message is due, and who has to read it."""

import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

from bodycam_ros.camera.camera_image import CameraImage, decode_grey
from bodycam_ros.errors import RecordingError
from bodycam_ros.live.dropped_messages import DroppedMessages
from bodycam_ros.live.node_parameters import PlayerParameters
from bodycam_ros.messages.diagnostics import Status, StatusLevel, few
from bodycam_ros.messages.factory import Message, header_message, optical_frame
from bodycam_ros.messages.images import compressed_video, image_stamp_ns
from bodycam_ros.recording.bag_file import BagFile
from bodycam_ros.recording.typestore import COMPRESSED_VIDEO, recorded_messages, recording_typestore
from bodycam_ros.recording.video_decoder import VideoDecoder


class PlayedTime:
    """The clock of a recording that is played.

    Args:
        rate: times the speed at which it was recorded.
        is_paused: whether it stands still at first.

    Attributes:
        is_paused: whether it stands still.
    """

    def __init__(self, rate: float, is_paused: bool = False) -> None:
        self._rate = rate
        self.is_paused = is_paused
        self._at_ns = 0
        self._since_s = time.monotonic()
        self._steps = 0

    @property
    def now_ns(self) -> int:
        """Where it is [ns]."""
        if self.is_paused:
            return self._at_ns
        return self._at_ns + round(1e9 * self._rate * (time.monotonic() - self._since_s))

    def go_to(self, at_ns: int) -> None:
        """Go on from somewhere else."""
        self._at_ns, self._since_s = at_ns, time.monotonic()

    def pause(self) -> None:
        """Stand still."""
        self.go_to(self.now_ns)
        self.is_paused = True

    def resume(self) -> None:
        """Go on."""
        self.go_to(self.now_ns)
        self.is_paused, self._steps = False, 0

    def set_rate(self, rate: float) -> None:
        """Go on at another rate."""
        self.go_to(self.now_ns)
        self._rate = rate

    def step(self) -> bool:
        """Play what is due next, while it stands still; False where it does not."""
        self._steps += self.is_paused
        return self.is_paused

    def left_s(self, due_ns: int) -> float:
        """How long it takes until something is due [s]; without end while it stands still before that."""
        left_ns = due_ns - self.now_ns
        return math.inf if self.is_paused and left_ns > 0 else 1e-9 * left_ns / self._rate

    def left_or_step_s(self, due_ns: int) -> float:
        """The same; a step that was asked for goes there."""
        if self._steps and self.is_paused and self.left_s(due_ns) > 0.0:
            self._steps -= 1
            self.go_to(due_ns)
        return self.left_s(due_ns)


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


class Playback:
    """Plays some cameras of a bag; close it, or use it as a context.

    Args:
        path: of the bag.
        of: the player's parameters.
        time: where it is; moved to the start.
        frame_prefix: before the names of the cameras' frames.
        plays_video: whether ROS has the type of videos here.
        dropped: counts frames that cannot be decoded.
        warn: takes a line for the user.

    Attributes:
        played: topic -> type of what is played.
        count: messages so far, of this time through.
        behind_s: by how much the latest was late at most [s].

    Raises:
        RecordingError: the bag cannot be read, or has none of the cameras.
    """

    def __init__(
        self,
        path: Path,
        of: PlayerParameters,
        time: PlayedTime,
        frame_prefix: str,
        plays_video: bool,
        dropped: DroppedMessages,
        warn: Callable[[str], object],
    ) -> None:
        self._of, self._dropped = of, dropped
        self._bag = BagFile(path).__enter__()
        self._time = time
        time.go_to(self._bag.start_ns - 1)
        chosen = _chosen(path, self._bag.topics, of.cameras, warn)
        refuse: Callable[[str], object] = lambda reason: dropped.add("frames dropped", reason)  # noqa: E731
        self._video = PlayedVideo(chosen, refuse, frame_prefix, plays_video)
        self.played = self._video.played
        self.count, self.behind_s = 0, 0.0

    def __enter__(self) -> "Playback":
        return self

    def __exit__(self, *error: object) -> None:
        self._bag.__exit__(None, None, None)

    def messages(self) -> Iterator[tuple[int, str, int, bytes]]:
        """When each message is due [ns], its topic, the stamp of an image [ns], and its CDR; from the bag's start."""
        self.count, self.behind_s = 0, 0.0
        # While it is paused nothing is due there.
        self._time.go_to(self._bag.start_ns - 1)
        self._video.begin()
        recorded_ns = self._bag.start_ns
        for topic, recorded_ns, message in self._bag.messages(self._video.sources):
            self.behind_s = max(self.behind_s, -self._time.left_s(recorded_ns))
            stamp_ns = image_stamp_ns(message) if topic.endswith(IMAGES) else 0
            for played, serialized in self._video.serialized(topic, message):
                self.count += 1
                yield recorded_ns, played, stamp_ns, serialized
        for played, serialized in self._video.rest():
            self.count += 1
            yield recorded_ns, played, 0, serialized

    def lacking(self, readers: int, images: Callable[[str], int], infos: Callable[[str], int]) -> list[str]:
        """What too few nodes read, with how many do.

        Args:
            readers: of each camera_info that are wanted; of images one is enough.
            images, infos: count the readers of a topic of images, and of camera_info.
        """
        lacking = []
        for camera in dict.fromkeys(map(camera_of, self.played)):
            of_images = [f"/{camera}{ending}" for ending in IMAGES if f"/{camera}{ending}" in self.played]
            # A bag may have them raw and compressed, and nobody needs both.
            if of_images and not any(map(images, of_images)):
                lacking.append(f"{of_images[0]} (nobody)")
            info = f"/{camera}{INFO}"
            if camera not in self._of.image_only and info in self.played and (count := infos(info)) < readers:
                lacking.append(f"{info} ({count} of {readers} nodes)")
        return lacking

    def report(self, name: str, text: str, lacking: Sequence[str]) -> Status:
        """How far it is."""
        values: dict[str, object] = {
            "messages played": self.count,
            "at [s]": round(1e-9 * self._time.now_ns, 1),
            "behind at most [s]": round(self.behind_s, 2),
            "readers lacking": few(lacking) or "none",
            **self._dropped.values,
        }
        return Status(name, StatusLevel.WARN if lacking else StatusLevel.OK, text, values)


def _chosen(path: Path, there: dict[str, str], asked: Sequence[str], warn: Callable[[str], object]) -> dict[str, str]:
    """Topic -> type of what is to be played."""
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
