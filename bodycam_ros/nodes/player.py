"""Node ``player``: publishes the cameras of a bag, where there is no ``ros2 bag play`` or where nothing may be lost.

It starts once everybody listens, so that the graph hears the first image too.
"""

import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from rclpy.duration import Duration

from bodycam_ros.errors import RecordingError
from bodycam_ros.nodes.parameters import PlayerParameters
from bodycam_ros.nodes.qos import STAGE_DEPTH, reliable
from bodycam_ros.nodes.run import run
from bodycam_ros.nodes.stage_node import StageNode
from bodycam_ros.recording.bag_file import BagFile
from bodycam_ros.recording.typestore import recording_typestore

_INFO, _IMAGES = "/camera_info", ("/image_raw/compressed", "/image_raw")
_LOOK_S = 0.1
_LAST_WORDS = Duration(seconds=30)


class Player(StageNode[PlayerParameters]):
    """Publishes a bag's images and camera_info at a multiple of the speed at which they were recorded."""

    def __init__(self) -> None:
        super().__init__("player", PlayerParameters)
        self._path = Path(self.required("bag"))

    def work(self, stopped: Callable[[], bool]) -> None:
        """Wait for readers, play the bag, and wait until the readers have everything."""
        with BagFile(self._path) as bag:
            topics = {topic: kind for topic, kind in bag.topics.items() if topic.endswith((_INFO, *_IMAGES))}
            if not any(topic.endswith(_IMAGES) for topic in topics):
                raise RecordingError(f"{self._path}: no camera to play; expected topics such as /head{_IMAGES[0]}")
            publishers = {topic: self.publisher(kind, topic, reliable(STAGE_DEPTH)) for topic, kind in topics.items()}
            self._wait_for_readers(publishers, stopped)
            self._play(bag, topics, publishers, stopped)
        for publisher in publishers.values():
            if not stopped():
                publisher.wait_for_all_acked(_LAST_WORDS)

    def _wait_for_readers(self, publishers: dict[str, Any], stopped: Callable[[], bool]) -> None:
        wanted = {topic: self.parameters.readers if topic.endswith(_INFO) else 1 for topic in publishers}
        deadline_s = time.monotonic() + self.parameters.reader_wait
        while self.parameters.readers and not stopped():
            lacking = {topic for topic, each in publishers.items() if each.get_subscription_count() < wanted[topic]}
            if not lacking:
                time.sleep(self.parameters.settle)
                return
            if time.monotonic() > deadline_s:
                raise RecordingError(
                    f"after {self.parameters.reader_wait:g} s nobody, or not everybody, reads "
                    f"{_few(sorted(lacking))}; start the other nodes, or do not wait (-p readers:=0)"
                )
            time.sleep(_LOOK_S)

    def _play(
        self, bag: BagFile, topics: dict[str, str], publishers: dict[str, Any], stopped: Callable[[], bool]
    ) -> None:
        started_s = time.monotonic()
        behind_s, count = 0.0, 0
        for topic, recorded_ns, message in bag.messages(topics):
            due_s = started_s + 1e-9 * (recorded_ns - bag.start_ns) / self.parameters.rate
            behind_s = max(behind_s, time.monotonic() - due_s)
            time.sleep(max(0.0, due_s - time.monotonic()))
            if stopped():
                return
            publishers[topic].publish(bytes(recording_typestore().serialize_cdr(message, topics[topic])))
            count += 1
        elapsed_s = time.monotonic() - started_s
        self.get_logger().info(f"played {count} messages in {elapsed_s:.1f} s, at most {behind_s:.2f} s behind")


def _few(topics: Sequence[str]) -> str:
    more = f" and {len(topics) - 3} more topics" if len(topics) > 3 else ""
    return ", ".join(topics[:3]) + more


def main() -> int:
    """Run the node until it is stopped; its exit code."""
    return run(Player, "player")
