"""A bag that is played: what of it, when each message is due, and who has to read it."""

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from bodycam_ros.errors import RecordingError
from bodycam_ros.live.flow_of_frames import Skipped
from bodycam_ros.live.node_parameters import PlayerParameters
from bodycam_ros.live.played_time import PlayedTime
from bodycam_ros.live.played_video import IMAGES, INFO, PlayedVideo, camera_of
from bodycam_ros.messages.images import image_stamp_ns
from bodycam_ros.messages.status import Health, HealthLevel, few
from bodycam_ros.recording.bag_file import BagFile


class Playback:
    """Plays some cameras of a bag; close it, or use it as a context.

    Args:
        path: of the bag.
        of: the player's parameters.
        time: where it is; moved to the start.
        frame_prefix: before the names of the cameras' frames.
        plays_video: whether ROS has the type of videos here.
        skipped: counts frames that cannot be decoded.
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
        skipped: Skipped,
        warn: Callable[[str], object],
    ) -> None:
        self._of, self._skipped = of, skipped
        self._bag = BagFile(path).__enter__()
        self._time = time
        time.go_to(self._bag.start_ns - 1)
        chosen = _chosen(path, self._bag.topics, of.cameras, warn)
        refuse: Callable[[str], object] = lambda reason: skipped.add("frames skipped", reason)  # noqa: E731
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

    def health(self, name: str, text: str, lacking: Sequence[str]) -> Health:
        """How far it is."""
        values: dict[str, object] = {
            "messages played": self.count,
            "at [s]": round(1e-9 * self._time.now_ns, 1),
            "behind at most [s]": round(self.behind_s, 2),
            "readers lacking": few(lacking) or "none",
            **self._skipped.counts,
        }
        return Health(name, HealthLevel.WARN if lacking else HealthLevel.OK, text, values)


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
