"""Topics within one process: readers get the very message that was published, not a copy of it.

rclpy has no such thing: two nodes of one process talk through the middleware, which serializes every message, and makes
another one of it for each reader. Messages are shared here, so nobody may change one that was heard or published.
"""

import threading
from collections import defaultdict, deque
from collections.abc import Callable
from contextlib import nullcontext
from typing import Any

from rclpy.executors import Executor
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSCompatibility, QoSProfile, qos_check_compatible


class Arrivals:
    """What is to be called in a node: on its executor's thread, in the order in which it arrived."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._executor: Executor | None = None
        self._waiting: list[Callable[[], None]] = []

    def add(self, callback: Callable[[], None]) -> None:
        """Call back once; as soon as there is an executor."""
        if self._executor is None:
            with self._lock:
                if self._executor is None:
                    self._waiting.append(callback)
                    return
        self._executor.create_task(callback)

    def begin(self, executor: Executor) -> None:
        """From now on there is one."""
        with self._lock:
            for callback in self._waiting:
                executor.create_task(callback)
            self._waiting.clear()
            self._executor = executor


class InProcessReader:
    """Who hears a topic within the process, and the messages that wait for it: the latest, as many as its depth.

    Args:
        topic: its whole name.
        quality: of service.
        callback: takes a message.
        arrivals: of the node.
    """

    def __init__(self, topic: str, quality: QoSProfile, callback: Callable[[Any], None], arrivals: Arrivals) -> None:
        self.topic, self.quality = topic, quality
        self._callback = callback
        self._arrivals = arrivals
        self._lock = threading.Lock()
        self._waiting: deque[Any] = deque(maxlen=_depth(quality))

    def deliver(self, message: Any) -> None:
        """A message has been published."""
        with self._lock:
            is_full = len(self._waiting) == self._waiting.maxlen
            self._waiting.append(message)
        # Where the oldest gave way, somebody is on the way to take one already.
        if not is_full:
            self._arrivals.add(self._take)

    def close(self) -> None:
        """Nothing that still waits is heard any more."""
        with self._lock:
            self._waiting.clear()

    def _take(self) -> None:
        with self._lock:
            if not self._waiting:
                return
            message = self._waiting.popleft()
        self._callback(message)


class InProcessWriter:
    """Who publishes on a topic within the process.

    Args:
        topic: its whole name.
        quality: of service.

    Attributes:
        is_latched: whether those who come later hear the latest messages.
        latched: these.
        readers: who hears it.
    """

    def __init__(self, topic: str, quality: QoSProfile) -> None:
        self.topic, self.quality = topic, quality
        self.is_latched = _is_latched(quality)
        self.latched: deque[Any] = deque(maxlen=_depth(quality) if self.is_latched else 0)
        self.readers: tuple[InProcessReader, ...] = ()


class InProcessTopics:
    """All topics of a process.

    Quality of service means what it means between processes: who does not fit together does not meet, a reader that
    falls behind loses the oldest messages, latched messages also reach those that come later. Nothing gets lost on the
    way, so best effort is as good as reliable.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._writers: defaultdict[str, list[InProcessWriter]] = defaultdict(list)
        self._readers: defaultdict[str, list[InProcessReader]] = defaultdict(list)

    def add_writer(self, writer: InProcessWriter) -> None:
        """Somebody publishes from now on."""
        with self._lock:
            self._writers[writer.topic].append(writer)
            writer.readers = tuple(r for r in self._readers[writer.topic] if _fits(writer.quality, r.quality))

    def remove_writer(self, writer: InProcessWriter) -> None:
        """Somebody publishes no more; what it had latched goes with it."""
        with self._lock:
            self._writers[writer.topic].remove(writer)

    def add_reader(self, reader: InProcessReader) -> None:
        """Somebody listens from now on, and hears what is latched."""
        with self._lock:
            self._readers[reader.topic].append(reader)
            for writer in self._writers[reader.topic]:
                if _fits(writer.quality, reader.quality):
                    writer.readers += (reader,)
                    for message in writer.latched if _is_latched(reader.quality) else ():
                        reader.deliver(message)

    def remove_reader(self, reader: InProcessReader) -> None:
        """Somebody listens no more."""
        with self._lock:
            self._readers[reader.topic].remove(reader)
            for writer in self._writers[reader.topic]:
                writer.readers = tuple(each for each in writer.readers if each is not reader)
        reader.close()

    def publish(self, writer: InProcessWriter, message: Any) -> None:
        """Deliver a message, and keep it where it is latched."""
        # Latched ones are few; for the others nobody waits for anybody.
        with self._lock if writer.is_latched else nullcontext():
            writer.latched.append(message)
            for reader in writer.readers:
                reader.deliver(message)


def _is_latched(quality: QoSProfile) -> bool:
    return bool(quality.durability == DurabilityPolicy.TRANSIENT_LOCAL)


def _depth(quality: QoSProfile) -> int | None:
    return None if quality.history == HistoryPolicy.KEEP_ALL else max(1, quality.depth)


def _fits(offered: QoSProfile, wanted: QoSProfile) -> bool:
    return bool(qos_check_compatible(offered, wanted)[0] != QoSCompatibility.ERROR)
