"""Nodes under test, in this process or in their own, and a node that records what they publish. It needs rclpy."""

import gc
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import Any

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.serialization import deserialize_message
from rclpy.signals import SignalHandlerOptions

from bodycam_ros.errors import BodycamError
from bodycam_ros.graph.declared_graph import READERS_OF_INFO, USER_ERROR, GraphArguments, GraphNode, graph
from bodycam_ros.messages.factory import stamp_ns
from bodycam_ros.nodes.parameters import latched, message_class, reliable
from bodycam_ros.nodes.process import ignore_discovery
from bodycam_ros.recording.bag_writer import is_latched, write_recording
from helpers.own_domain import own_domain
from helpers.owned_processes import ended_with_us

_REPOSITORY = Path(__file__).parents[2]
_DEPTH = 5000
_ASKED = 4
_START_S, _GRACE_S = 60.0, 30.0


def live_graph(
    reference_map: Path | str, body: Path, cameras: Sequence[str] = (), registrations: int = 1, **given: Any
) -> list[GraphNode]:
    """The nodes of the graph of a map and a body."""
    cameras = tuple(cameras)
    return graph(
        GraphArguments(map=str(reference_map), body=str(body), cameras=cameras, registrations=registrations, **given)
    )


def player(bag: Path, rate: float, cameras: Sequence[str] = (), **given: Any) -> GraphNode:
    """A player that waits for the whole graph."""
    chosen = {"cameras": [*cameras]} if cameras else {}
    return GraphNode(
        "player", "player", {"bagfile": str(bag), "rate": rate, "readers": READERS_OF_INFO, **chosen, **given}
    )


def full_name(node: GraphNode) -> str:
    """Name of a node with its namespace, as diagnostics have it."""
    return f"{node.namespace}/{node.name}".strip("/")


class Started:
    """A node's process and what it printed."""

    def __init__(self, node: GraphNode, folder: Path) -> None:
        self.node = node
        self._log = folder / f"{full_name(node).replace('/', '.')}.log"
        command = [sys.executable, "-m", "bodycam_ros.nodes.start", node.executable, *node.arguments()]
        with self._log.open("w") as log:
            self.process = subprocess.Popen(
                ended_with_us(command), stdout=log, stderr=subprocess.STDOUT, cwd=_REPOSITORY
            )

    @property
    def is_over(self) -> bool:
        """Whether the process has ended."""
        return self.process.poll() is not None

    @property
    def log(self) -> str:
        """All that it printed."""
        return self._log.read_text()

    @property
    def printed(self) -> str:
        """Its output, without the warnings of Fast DDS on ports that two processes open at the same time."""
        return "".join(line for line in self.log.splitlines(keepends=True) if "RTPS_TRANSPORT_SHM" not in line)

    def interrupt(self) -> None:
        """Send SIGINT, twice, as a launch file does."""
        for _ in range(2):
            if self.process.poll() is None:
                self.process.send_signal(signal.SIGINT)

    def end(self) -> int:
        """Exit code; a process that still runs is interrupted."""
        self.interrupt()
        try:
            return self.process.wait(_GRACE_S)
        except subprocess.TimeoutExpired:
            self.process.kill()
            raise


class Running:
    """A node that works in this process, on a thread with an executor of its own.

    Attributes:
        inside: the node itself.
        error: what ended its work, or None.

    Raises:
        BodycamError: the node cannot be brought up.
    """

    def __init__(self, node: GraphNode) -> None:
        self.node = node
        self.error: BaseException | None = None
        self._over, self._leaves = threading.Event(), True
        self.inside: Any = import_module(f"bodycam_ros.nodes.{node.executable}").make(node.arguments())
        try:
            self.inside.bring_up()
        except BodycamError:
            _leave(self.inside)
            raise
        self._thread = threading.Thread(target=self._work, name=node.name, daemon=True)
        self._thread.start()

    @property
    def is_over(self) -> bool:
        """Whether the node's work has ended."""
        return not self._thread.is_alive()

    def end(self) -> int:
        """Exit code that the node's process would have; a node that still works is ended first."""
        self._over.set()
        self._thread.join(_GRACE_S)
        assert self.is_over, f"{self.node.name} does not end"
        if self.error is not None and not isinstance(self.error, BodycamError):
            raise self.error
        return USER_ERROR if self.error is not None else 0

    def crash(self) -> None:
        """End the work without the last steps of a node that leaves."""
        self._leaves = False
        self.end()

    def forget(self) -> None:
        """Keep no reference to the node: its participant in DDS ends with the last one."""
        del self.inside

    def _work(self) -> None:
        try:
            self.inside.work(self._over.is_set)
            if self._leaves:
                self.inside.finish()
        except BaseException as error:
            self.error = error
        finally:
            _leave(self.inside)


class Graph:
    """Nodes under test and the messages that the test has received, serialized, by topic."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._context = rclpy.Context()
        rclpy.init(context=self._context)
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
        self._node = rclpy.create_node("listener", context=self._context)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._types: dict[str, str] = {}
        self._clients: dict[str, Any] = {}
        self.started: list[Started] = []
        self.running: list[Running] = []
        self.heard: defaultdict[str, list[bytes]] = defaultdict(list)

    def start(self, *nodes: GraphNode) -> list[Started]:
        """Start processes; the listener must subscribe before."""
        new = [Started(node, self._folder) for node in nodes]
        self.started += new
        return new

    def run(self, *nodes: GraphNode) -> list[Running]:
        """Let nodes work in this process; the listener must subscribe before."""
        new = []
        for node in nodes:
            new.append(Running(node))
            self.running.append(new[-1])
        return new

    def listen(self, topics: dict[str, str]) -> None:
        """Keep the messages of topics, given with their types."""
        for topic, type_name in topics.items():
            self._types[topic] = type_name
            # Several may publish once: of depth 1 the latest of all of them would be left.
            quality = latched(_DEPTH) if is_latched(topic) else reliable(_DEPTH)
            self._node.create_subscription(message_class(type_name), topic, self.heard[topic].append, quality, raw=True)

    def until_known(self, timeout_s: float) -> None:
        """Wait until all nodes that were started have matched the listener's subscriptions, diagnostics last."""
        names = {full_name(each.node) for each in (*self.started, *self.running)}
        reported: set[str] = set()

        def all_speak() -> bool:
            reported.update(s.name.split(":")[0] for m in self.messages("/diagnostics", -1) for s in m.status)
            return names <= reported

        self.until(all_speak, timeout_s, f"diagnostics of {', '.join(sorted(names))}")

    def publisher(self, topic: str, type_name: str, quality: Any = None) -> Any:
        return self._node.create_publisher(message_class(type_name), topic, quality or reliable(_DEPTH))

    def count_publishers(self, topic: str) -> int:
        """How many publishers of a topic the listener has found; one that was killed counts for some seconds more."""
        return int(self._node.count_publishers(topic))

    def offers(self, topic: str) -> list[Any]:
        """Quality of service of those who publish a topic."""
        return [each.qos_profile for each in self._node.get_publishers_info_by_topic(topic)]

    @property
    def listener(self) -> Any:
        """The node that listens, by which to ask what there is."""
        return self._node

    def ask(self, service: str, service_type: Any, **fields: Any) -> Any:
        """Call a service; a future of its answer."""
        client = self._clients.get(service) or self._node.create_client(service_type, service)
        self._clients[service] = client
        assert client.wait_for_service(_START_S), self.report()
        return client.call_async(service_type.Request(**fields))

    def call(self, service: str, service_type: Any, **fields: Any) -> Any:
        """Call a service and wait for its answer; ask again where a node that was just found has not found us yet."""
        for _ in range(_ASKED):
            future = self.ask(service, service_type, **fields)
            self._executor.spin_until_future_complete(future, _GRACE_S / _ASKED)
            if future.done():
                return future.result()
        raise AssertionError(f"{service} does not answer\n{self.report()}")

    def until(self, condition: Callable[[], object], timeout_s: float, what: str) -> None:
        """Listen until something is the case."""
        deadline_s = time.monotonic() + timeout_s
        while not condition():
            assert time.monotonic() < deadline_s, f"after {timeout_s:g} s still not: {what}\n{self.report()}"
            self._executor.spin_once(0.05)

    def messages(self, topic: str, start: int = 0) -> list[Any]:
        """Messages of a topic, from a message of a number on; of a negative number, the latest."""
        return [deserialize_message(cdr, message_class(self._types[topic])) for cdr in self.heard[topic][start:]]

    def all_diagnostics(self, part: str) -> list[dict[str, Any]]:
        """Level, text and values of all reports on a part, named with its node."""
        return [
            {"level": status.level[0], "text": status.message} | {value.key: value.value for value in status.values}
            for message in self.messages("/diagnostics")
            for status in message.status
            if status.name == part
        ]

    def diagnostics(self, part: str) -> dict[str, Any]:
        """Level, text and values of the last report on a part; empty if there is none."""
        reports = self.all_diagnostics(part)
        return reports[-1] if reports else {}

    def write(self, path: Path) -> Path:
        """The messages as a bag."""
        with write_recording(path) as writer:
            for topic, heard in self.heard.items():
                for cdr, message in zip(heard, self.messages(topic), strict=True):
                    stamp = stamp_ns(message.header.stamp) if hasattr(message, "header") else 0
                    writer.write_serialized(topic, self._types[topic], stamp, cdr)
        return path

    def report(self) -> str:
        """Counts of messages and output of the processes, for a failure's message."""
        counts = (f"{topic}: {len(heard)} messages heard" for topic, heard in sorted(self.heard.items()))
        texts = (f"--- {full_name(each.node)} ({each.process.poll()})\n{each.log}" for each in self.started)
        errors = (f"--- {full_name(each.node)}: {each.error!r}" for each in self.running)
        return "\n".join((*counts, *texts, *errors))

    def end(self) -> dict[str, int]:
        """Interrupt all processes at once, as a launch file does, and end the others; exit codes by full name."""
        for each in self.started:
            each.interrupt()
        return {full_name(each.node): each.end() for each in (*self.running, *self.started)}

    def close(self) -> None:
        for each in self.started:
            if each.process.poll() is None:
                each.process.kill()
                each.process.wait()
        self._node.destroy_node()
        rclpy.shutdown(context=self._context)
        try:
            for running in self.running:
                running.end()
                running.forget()
        finally:
            rclpy.try_shutdown()
            gc.collect()
            if self.started:
                _free_shared_memory()


def _leave(node: Node) -> None:
    ignore_discovery(node)
    node.destroy_node()


def _free_shared_memory() -> None:
    """Remove what processes that were killed left in /dev/shm: 17 MB each, which nobody else ever frees."""
    tool = shutil.which("fastdds", path=os.pathsep.join([str(Path(sys.prefix) / "bin"), os.environ.get("PATH", "")]))
    assert tool, "fastdds, which is installed with rmw_fastrtps, is not there"
    subprocess.run([tool, "shm", "clean"], check=True, capture_output=True)


@contextmanager
def running_graph(folder: Path) -> Iterator[Graph]:
    """A graph without processes yet, on a DDS domain of its own that does not leave the machine."""
    with own_domain() as domain:
        yield from _graph_on(domain, folder)


def _graph_on(domain: int, folder: Path) -> Iterator[Graph]:
    ours = {
        "ROS_DOMAIN_ID": str(domain),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        "FASTRTPS_DEFAULT_PROFILES_FILE": str(_REPOSITORY / "config/fastdds-shm.xml"),
        "RMW_IMPLEMENTATION": "rmw_fastrtps_cpp",
    }
    before = {name: os.environ.get(name) for name in ours}
    os.environ.update(ours)
    try:
        graph = Graph(folder)
        try:
            yield graph
        finally:
            graph.close()
    finally:
        for name, value in before.items():
            os.environ.pop(name, None) if value is None else os.environ.update({name: value})
