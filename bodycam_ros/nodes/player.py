"""Node ``player``: publishes the cameras of a bag, where there is no ``ros2 bag play`` or where nothing may be lost.

It starts once everybody listens, so that the graph hears the first image too. Stamps stay as they were recorded.
"""

import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

from rclpy.duration import Duration
from rclpy.task import Future

from bodycam_ros.errors import RecordingError
from bodycam_ros.messages.images import image_stamp_ns
from bodycam_ros.messages.status import Health, HealthLevel
from bodycam_ros.moments import Moment
from bodycam_ros.nodes.playback import Playback
from bodycam_ros.nodes.played_topics import IMAGES, PlayedTopics, camera_of, few
from bodycam_ros.nodes.played_video import PlayedVideo
from bodycam_ros.nodes.player_parameters import PlayerParameters
from bodycam_ros.nodes.run import run
from bodycam_ros.nodes.stage_node import StageNode, light_executor
from bodycam_ros.recording.bag_file import BagFile

_SLICE_S = 0.1
"""So soon it hears that it is to stop, whatever it waits for."""

_SHORT_S = 0.02

_REPORT_S, _COMPLAINT_S = 1.0, 5.0
_LAST_WORDS_S = 30.0


class Player(StageNode[PlayerParameters]):
    """Publishes a bag's images and camera_info at a multiple of the speed at which they were recorded.

    It can be paused, told to play what comes next, and given another rate while it plays. It is no managed node: what
    it is there for is over when the bag is.
    """

    is_managed = False

    def __init__(self, arguments: Sequence[str] = ()) -> None:
        super().__init__("player", PlayerParameters, arguments=arguments)
        self._path = Path(self.required("bag"))
        self._played = 0
        self._behind_s = 0.0
        self._report_due_s = 0.0
        self._complaint_due_s = 0.0
        self._unread_since_s: float | None = None
        self._playback = Playback(self)
        self._never = Future()
        self._served_s = 0.0

    def settings_changed(self) -> None:
        """Go on at the rate that is said now."""
        self._playback.time.set_rate(self.parameters.rate)

    def work(self, stopped: Callable[[], bool]) -> None:
        """Wait for readers, play the bag, and wait until the readers have everything."""
        self._executor = light_executor()
        self._executor.add_node(self)
        with BagFile(self._path) as bag:
            self._playback.begin(bag.start_ns)
            prefix = self.parameters.frame_prefix
            video = PlayedVideo(self._chosen(bag), lambda reason: self.skipped.add("frames skipped", reason), prefix)
            topics = PlayedTopics(self, video.played)
            self._wait_for_readers(topics, stopped)
            while not stopped():
                self._play(bag, video, topics, stopped)
                if not self.parameters.loop or not self._played:
                    break
        deadline_s = time.monotonic() + _LAST_WORDS_S
        while not stopped() and time.monotonic() < deadline_s:
            if topics.are_heard(Duration(nanoseconds=int(1e9 * _SLICE_S))):
                break
        self._executor.remove_node(self)

    def _chosen(self, bag: BagFile) -> dict[str, str]:
        """Topic -> type of what is to be played."""
        topics = {topic: kind for topic, kind in bag.topics.items() if camera_of(topic)}
        there = dict.fromkeys(camera_of(topic) for topic in topics if topic.endswith(IMAGES))
        if not there:
            raise RecordingError(f"{self._path}: no camera to play; expected topics such as /head{IMAGES[0]}")
        asked = self.parameters.cameras
        if not asked:
            return topics
        played = [camera for camera in there if camera in asked]
        if not played:
            raise RecordingError(f"{self._path}: has no images of {', '.join(asked)}; it has {', '.join(there)}")
        if lacking := [camera for camera in asked if camera not in there]:
            self.get_logger().warning(f"{self._path} has no images of {', '.join(lacking)}")
        if left_out := [camera for camera in there if camera not in played]:
            self.get_logger().info(f"plays {', '.join(played)}; leaves out {', '.join(left_out)}")
        return {topic: kind for topic, kind in topics.items() if camera_of(topic) in asked}

    def _wait_for_readers(self, topics: PlayedTopics, stopped: Callable[[], bool]) -> None:
        if not self.parameters.readers:
            return
        started_s = time.monotonic()
        while not stopped() and (lacking := topics.lacking(self.parameters.readers, self.parameters.image_only)):
            waited_s = time.monotonic() - started_s
            if waited_s > self.parameters.reader_wait:
                raise RecordingError(
                    f"after {self.parameters.reader_wait:g} s nobody, or not everybody, reads {few(lacking)}; "
                    "start the other nodes, play only the cameras that they read (-p cameras:=...), or do not wait "
                    "(-p readers:=0)"
                )
            if waited_s > _COMPLAINT_S:
                self._complain(lacking, f"waits until {self.parameters.readers} nodes read each camera; lacking are")
            self._report_now_and_then("waiting for readers", lacking)
            self._playback.tell()
            self._serve(_SLICE_S)
        settled_s = time.monotonic() + self.parameters.settle
        self._wait(lambda: settled_s - time.monotonic(), topics, stopped)

    def _play(self, bag: BagFile, video: PlayedVideo, topics: PlayedTopics, stopped: Callable[[], bool]) -> None:
        started_s = time.monotonic()
        self._played, self._behind_s = 0, 0.0
        self._playback.begin(bag.start_ns)
        video.begin()
        for topic, recorded_ns, message in bag.messages(video.sources):
            self._behind_s = max(self._behind_s, -self._playback.time.left_s(recorded_ns))
            self._wait(partial(self._playback.left_s, recorded_ns), topics, stopped)
            if stopped():
                return
            for played, serialized in video.serialized(topic, message):
                if played.endswith(IMAGES):
                    self.moments.note(Moment.PLAYED, camera_of(played), image_stamp_ns(message))
                topics.publish(played, serialized)
                self._played += 1
        for played, serialized in video.rest():
            topics.publish(played, serialized)
            self._played += 1
        elapsed_s = time.monotonic() - started_s
        self.get_logger().info(
            f"played {self._played} messages in {elapsed_s:.1f} s, at most {self._behind_s:.2f} s behind"
        )

    def _wait(self, left: Callable[[], float], topics: PlayedTopics, stopped: Callable[[], bool]) -> None:
        """Serve who asks, and do what is to be done now and then; at least look once whether something is.

        Args:
            left: how long [s].
        """
        while not stopped():
            topics.repeat_infos()
            self._look_for_unread(topics)
            told_s, left_s = self._playback.tell(), left()
            if left_s > 0.0 or time.monotonic() - self._served_s > _SLICE_S:
                self._serve(max(0.0, min(left_s, told_s, _SLICE_S)))
            if left_s <= 0.0:
                return

    def _serve(self, seconds: float) -> None:
        """Wait, and answer who asks meanwhile; not at every short wait, for that costs more than the message."""
        if seconds < _SHORT_S and time.monotonic() - self._served_s < _SLICE_S:
            time.sleep(seconds)
            return
        self._executor.spin_until_future_complete(self._never, seconds)
        self._served_s = time.monotonic()

    def _look_for_unread(self, topics: PlayedTopics) -> None:
        """Say what nobody reads: not at once, for a reader may be starting again."""
        now_s = time.monotonic()
        if now_s < self._report_due_s:
            return
        unread = topics.lacking(1, self.parameters.image_only)
        self._unread_since_s = (self._unread_since_s or now_s) if unread else None
        if self._unread_since_s is not None and now_s - self._unread_since_s > _COMPLAINT_S:
            self._complain(unread, "plays, but not everything is read:")
        self._report_now_and_then("paused" if self._playback.time.is_paused else "playing", unread)

    def _complain(self, lacking: Sequence[str], text: str) -> None:
        if time.monotonic() > self._complaint_due_s:
            self._complaint_due_s = time.monotonic() + _COMPLAINT_S
            self.get_logger().warning(f"{text} {few(lacking)}")

    def _report_now_and_then(self, text: str, lacking: Sequence[str]) -> None:
        now_s = time.monotonic()
        if now_s < self._report_due_s:
            return
        self._report_due_s = now_s + _REPORT_S
        values: dict[str, object] = {
            "messages played": self._played,
            "at [s]": round(1e-9 * self._playback.time.now_ns, 1),
            "behind at most [s]": round(self._behind_s, 2),
            "readers lacking": few(lacking) or "none",
            **self.skipped.counts,
        }
        level = HealthLevel.WARN if lacking else HealthLevel.OK
        # Real time: with use_sim_time the node's own clock may stand still.
        self.report(time.time_ns(), [Health(self.get_name(), level, text, values)])


def main() -> int:
    """Run the node until it is stopped; its exit code."""
    return run(Player, "player")
