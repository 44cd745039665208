"""A ROS 2 bag, folder or single file, as a stream of decoded messages."""

from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType

from rosbags.interfaces import Connection
from rosbags.rosbag2 import Reader

from bodycam_ros.errors import RecordingError
from bodycam_ros.messages.factory import Message
from bodycam_ros.recording.bag_fault import fault_of
from bodycam_ros.recording.typestore import recording_typestore


class BagFile:
    """Topics and messages of a ros2 bag folder or an .mcap file. A context manager.

    Standard messages are decoded as Jazzy has them; topics of types that we do not know can be listed, not read.

    Raises:
        RecordingError: on entering, if there is no readable bag; while reading, where it is damaged.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        with _fault_named(path):
            self._reader = Reader(path)

    def __enter__(self) -> "BagFile":
        with _fault_named(self.path):
            self._reader.open()
        return self

    def __exit__(
        self, error_type: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self._reader.close()

    @property
    def topics(self) -> dict[str, str]:
        """Topic -> message type ("sensor_msgs/msg/Image"), in the order of the topics' names."""
        return {c.topic: c.msgtype for c in sorted(self._reader.connections, key=lambda c: c.topic)}

    @property
    def start_ns(self) -> int:
        """When the first message was recorded [ns]."""
        return self._reader.start_time

    @property
    def duration_s(self) -> float:
        """From the first recorded message to the last [s]."""
        return max(0, self._reader.end_time - 1 - self._reader.start_time) * 1e-9 if self._reader.message_count else 0.0

    def message_count(self, topic: str) -> int:
        """Messages on a topic."""
        return sum(c.msgcount for c in self._connections([topic]))

    def messages(self, topics: Collection[str]) -> Iterator[tuple[str, int, Message]]:
        """Yield topic, time of recording [ns] and message, in order of that time.

        Parts of the file without these topics are not decompressed.
        """
        connections = self._connections(topics)
        if not connections:
            return
        decode = recording_typestore().deserialize_cdr
        stream = self._reader.messages(connections)
        while True:
            with _fault_named(self.path):
                item = next(stream, None)
                message = None if item is None else decode(item[2], item[0].msgtype)
            if item is None:
                return
            yield item[0].topic, item[1], message

    def _connections(self, topics: Collection[str]) -> list[Connection]:
        return [c for c in self._reader.connections if c.topic in topics]


@contextmanager
def _fault_named(path: Path) -> Iterator[None]:
    """Turn whatever a damaged or foreign file makes of the reader into one error that says what is wrong."""
    try:
        yield
    except Exception as error:  # a damaged file can raise nearly anything in a parser
        raise RecordingError(f"{path}: {fault_of(path) or f'cannot be read as a ROS 2 bag: {error!r}'}") from error
