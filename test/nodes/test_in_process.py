"""Topics within a process mean what they mean between processes, and carry the very messages."""

from collections import deque
from collections.abc import Callable
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed; 'make test' installs it")

from bodycam_ros.nodes.in_process import Arrivals, InProcessReader, InProcessTopics, InProcessWriter
from bodycam_ros.nodes.qos import best_effort, latched, reliable

TOPIC = "/head/tracks"


class Calls:
    """An executor that calls back when it is told to."""

    def __init__(self) -> None:
        self._tasks: deque[Callable[[], None]] = deque()

    def create_task(self, task: Callable[[], None]) -> None:
        self._tasks.append(task)

    def spin(self, most: int = 1000) -> int:
        """Call back; how often."""
        done = 0
        while self._tasks and done < most:
            self._tasks.popleft()()
            done += 1
        return done


class Node:
    """Hears topics in its own time."""

    def __init__(self, topics: InProcessTopics) -> None:
        self._topics = topics
        self.calls, self.arrivals = Calls(), Arrivals()
        self.heard: list[Any] = []

    def listen(self, quality: Any, topic: str = TOPIC) -> InProcessReader:
        reader = InProcessReader(topic, quality, self.heard.append, self.arrivals)
        self._topics.add_reader(reader)
        return reader

    def spin(self) -> list[Any]:
        """Hear what has arrived; all that was heard so far."""
        self.arrivals.begin(self.calls)  # type: ignore[arg-type]
        self.calls.spin()
        return self.heard


@pytest.fixture
def topics() -> InProcessTopics:
    return InProcessTopics()


def written(topics: InProcessTopics, quality: Any, topic: str = TOPIC) -> InProcessWriter:
    writer = InProcessWriter(topic, quality)
    topics.add_writer(writer)
    return writer


def test_all_readers_hear_the_same_objects_in_order(topics: InProcessTopics) -> None:
    writer, nodes = written(topics, reliable(1000)), [Node(topics), Node(topics)]
    for node in nodes:
        node.listen(reliable(1000))
    messages = [object() for _ in range(50)]
    for message in messages:
        topics.publish(writer, message)
    for node in nodes:
        assert [id(heard) for heard in node.spin()] == [id(message) for message in messages]


def test_topics_of_one_node_are_heard_in_the_order_in_which_they_were_published(topics: InProcessTopics) -> None:
    node = Node(topics)
    writers = [written(topics, reliable(10), topic) for topic in ("/left/tracks", "/right/tracks")]
    for writer in writers:
        node.listen(reliable(10), writer.topic)
    for number in range(6):
        topics.publish(writers[number % 2], number)
    assert node.spin() == list(range(6))


def test_who_falls_behind_loses_the_oldest(topics: InProcessTopics) -> None:
    writer, node = written(topics, reliable(1000)), Node(topics)
    node.listen(reliable(3))
    for number in range(10):
        topics.publish(writer, number)
    assert node.spin() == [7, 8, 9]
    # Only so many callbacks waited, too: an executor that never comes does not gather them.
    for number in range(10, 20):
        topics.publish(writer, number)
    assert node.calls.spin() == 3 and node.heard[3:] == [17, 18, 19]
    topics.publish(writer, 20)
    assert node.spin()[6:] == [20]


def test_the_latest_latched_messages_reach_who_comes_later_and_wants_them(topics: InProcessTopics) -> None:
    writer, early, late, indifferent = written(topics, latched(2)), Node(topics), Node(topics), Node(topics)
    early.listen(latched(5))
    for number in range(4):
        topics.publish(writer, number)
    late.listen(latched(5))
    indifferent.listen(reliable(5))
    topics.publish(writer, 4)
    assert (early.spin(), late.spin(), indifferent.spin()) == ([0, 1, 2, 3, 4], [2, 3, 4], [4])
    topics.remove_writer(writer)
    too_late = Node(topics)
    too_late.listen(latched(5))
    assert not too_late.spin()


def test_what_is_not_latched_is_not_kept(topics: InProcessTopics) -> None:
    writer, node = written(topics, reliable(5)), Node(topics)
    topics.publish(writer, "nobody listens")
    node.listen(reliable(5))
    topics.publish(writer, "somebody does")
    assert node.spin() == ["somebody does"]


@pytest.mark.parametrize(
    ("offered", "wanted", "meet"),
    [
        (reliable(5), best_effort(5), True),
        (latched(), reliable(5), True),
        (best_effort(5), reliable(5), False),
        (reliable(5), latched(), False),
    ],
)
@pytest.mark.parametrize("reader_first", [False, True])
def test_who_does_not_fit_together_does_not_meet(
    topics: InProcessTopics, offered: Any, wanted: Any, meet: bool, reader_first: bool
) -> None:
    node = Node(topics)
    if reader_first:
        node.listen(wanted)
    writer = written(topics, offered)
    if not reader_first:
        node.listen(wanted)
    topics.publish(writer, "word")
    assert len(writer.readers) == meet and node.spin() == ["word"] * meet


def test_who_has_gone_hears_nothing_and_does_not_count(topics: InProcessTopics) -> None:
    writer, node, other = written(topics, reliable(5)), Node(topics), Node(topics)
    reader = node.listen(reliable(5))
    other.listen(reliable(5), "/foot/tracks")
    topics.publish(writer, "on the way when it went")
    assert len(writer.readers) == 1
    topics.remove_reader(reader)
    topics.publish(writer, "after it went")
    assert not writer.readers and not node.spin() and not other.spin()


def test_what_arrives_before_there_is_an_executor_waits_for_it(topics: InProcessTopics) -> None:
    writer, node = written(topics, latched()), Node(topics)
    topics.publish(writer, 0)
    node.listen(latched(5))
    topics.publish(writer, 1)
    assert not node.calls.spin()
    node.arrivals.begin(node.calls)  # type: ignore[arg-type]
    topics.publish(writer, 2)
    node.calls.spin()
    assert node.heard == [0, 1, 2]
