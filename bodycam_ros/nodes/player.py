"""Node ``player``: publishes the cameras of a bag, without ``ros2 bag play``, and without loss.

It starts once all readers have subscribed, so that the graph gets the first image too. Stamps stay as recorded.
"""

import threading
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from functools import partial
from heapq import merge
from pathlib import Path
from typing import Any

from rclpy.clock import Clock, ClockType
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.qos_overriding_options import QoSOverridingOptions

from bodycam_ros.errors import RecordingError
from bodycam_ros.files.shown import few, other_than
from bodycam_ros.graph.node_parameters import PlayerParameters
from bodycam_ros.messages.diagnostics import Status, StatusLevel
from bodycam_ros.messages.factory import Message, time_message
from bodycam_ros.messages.images import INFO, TRANSPORTS, image_stamp_ns
from bodycam_ros.messages.imu import IMU_TOPIC, IMU_TYPE
from bodycam_ros.messages.timing import TIMING
from bodycam_ros.nodes.moments import Moment, Moments
from bodycam_ros.nodes.parameters import STAGE_DEPTH, NodeParameters, latched, message_class, node_messages, reliable
from bodycam_ros.nodes.process import spin
from bodycam_ros.nodes.stage_node import Diagnostics, frame_prefix
from bodycam_ros.recording.bag_file import BagFile
from bodycam_ros.recording.bag_writer import is_latched
from bodycam_ros.recording.imu_reader import sensor_topics
from bodycam_ros.recording.topic_names import TopicNames
from bodycam_ros.recording.typestore import recording_typestore

_IMAGES = tuple(transport.ending for transport in TRANSPORTS.values())
_CLOCK = "rosgraph_msgs/msg/Clock"

_LOOPS = (
    "the bag starts again, and its stamps jump back: tf2 of other nodes ignores transforms older than those it has; to "
    "have it reset, start graph and readers with use_sim_time:=true, or this node with -p clock:=40 and readers with it"
)

_SLICE_S = 0.1
"""Longest delay before the player stops on request."""

_REPORT_S, _COMPLAINT_S = 1.0, 5.0
_LAST_READERS_S = 30.0


class Player(Node):
    """Publishes a bag's images and camera_info at a multiple of the speed at which they were recorded.

    It is not a managed node: it ends with the bag.
    """

    def __init__(self, arguments: Sequence[str] = ()) -> None:
        super().__init__(
            "player",
            cli_args=[*arguments],
            automatically_declare_parameters_from_overrides=True,
            enable_logger_service=True,
        )

    def bring_up(self) -> None:
        """Read the parameters; raises SettingsError if one is wrong."""
        parameters: NodeParameters[PlayerParameters] = NodeParameters(self, PlayerParameters)
        self._given = given = parameters.own
        self._path = Path(parameters.required("bagfile"))
        parameters.is_configured = True
        self._prefix = frame_prefix(self, given.frame_prefix)
        self._make = node_messages(self._prefix)
        self._diagnostics = Diagnostics(self, self._make)
        self._moments = Moments(Path(given.moments) if given.moments else None)
        self._state, self._wanted = "waiting for readers", given.readers
        self._started_s: float | None = None
        self._count, self._behind_s = 0, 0.0  # since the start of the bag

    def work(self, stopped: Callable[[], bool]) -> None:
        """Wait for readers, play the bag, and wait until all is acknowledged.

        Raises:
            RecordingError: a bag cannot be read, has none of the cameras or of their inertial sensors, or is not read.
        """
        with ExitStack() as opened:
            self._open(opened)
            steady = Clock(clock_type=ClockType.STEADY_TIME)
            self.create_timer(_REPORT_S, self._report, clock=steady)
            if self._given.clock > 0.0:
                clock = self.create_publisher(message_class(_CLOCK), "/clock", reliable(1))
                self.create_timer(1.0 / self._given.clock, lambda: clock.publish(self._clock_message()), clock=steady)
            is_over = threading.Event()
            server = threading.Thread(target=spin, args=(self, is_over.is_set))
            server.start()
            opened.callback(server.join)
            opened.callback(is_over.set)
            self._wait_for_readers(stopped)
            self._state, self._wanted = "playing", 1
            while not stopped():
                self._play(stopped)
                if not self._given.loop or not self._count:
                    break
                if not self._given.clock:
                    self.get_logger().warning(_LOOPS, once=True)
            self._wait_until_received(stopped)

    def finish(self) -> None:
        """Write the times at which frames were published."""
        self._moments.write()

    def _open(self, opened: ExitStack) -> None:
        """Open the bags; choose what is played of them."""
        given, names = self._given, self._topic_names()
        bag = opened.enter_context(BagFile(self._path, names))
        self._start_ns = bag.start_ns
        self._sources = {bag: self._choose_topics(bag.topics)}
        if given.imu:
            sensors = opened.enter_context(BagFile(Path(given.imu), names))
            own = {_camera_of(topic) for topic in self._sources[bag] if topic.endswith(IMU_TOPIC)}
            others = {*map(_camera_of, self._sources[bag])} - own
            self._sources[sensors] = dict.fromkeys(sensor_topics(sensors, others), IMU_TYPE)
        self._types = {topic: kind for topics in self._sources.values() for topic, kind in topics.items()}
        self._outputs = {topic: self._publisher(topic, kind) for topic, kind in self._types.items()}

    def _topic_names(self) -> TopicNames:
        """Names of the bag's topics by the parameters, or by the node's namespace where the bag has it too."""
        given, own = self._given, self.get_namespace()
        prefix = given.prefix
        if not prefix and own != "/":
            with BagFile(self._path) as bag:
                has_own = any(topic.startswith(f"{own}/") and topic.endswith(_IMAGES) for topic in bag.topics)
            prefix = own if has_own else ""
        return TopicNames.parse(prefix, given.topics)

    def _choose_topics(self, there: dict[str, str]) -> dict[str, str]:
        """Topic -> type of what is played."""
        asked = self._given.cameras
        topics = {topic: kind for topic, kind in there.items() if _camera_of(topic)}
        cameras = dict.fromkeys(_camera_of(topic) for topic in topics if topic.endswith(_IMAGES))
        if not cameras:
            raise RecordingError(f"{self._path}: no camera to play; expected topics such as /head{_IMAGES[0]}")
        if not asked:
            return topics
        if not {*asked} & {*cameras}:
            raise RecordingError(f"{self._path}: has no images of {asked[0]}; {other_than(asked[0], cameras)}")
        if lacking := [camera for camera in asked if camera not in cameras]:
            self.get_logger().warning(f"{self._path} has no images of {', '.join(lacking)}")
        return {topic: kind for topic, kind in topics.items() if _camera_of(topic) in asked}

    def _publisher(self, topic: str, kind: str) -> Any:
        quality = latched() if is_latched(topic) else reliable(STAGE_DEPTH)
        options = QoSOverridingOptions.with_default_policies()
        # In the node's namespace, as a camera's driver would.
        name = topic.lstrip("/")
        return self.create_publisher(message_class(kind), name, quality, qos_overriding_options=options)

    @property
    def _now_ns(self) -> int:
        """Time of the recording that is played now [ns]; just before its start until then."""
        if self._started_s is None:
            return self._start_ns - 1
        return self._start_ns + round(1e9 * self._given.rate * (time.monotonic() - self._started_s))

    def _left_s(self, due_ns: int) -> float:
        """Time until a message is due [s]."""
        return 1e-9 * (due_ns - self._now_ns) / self._given.rate

    def _clock_message(self) -> Any:
        return self._make(_CLOCK, clock=time_message(self._make, self._now_ns))

    def _lacking(self) -> list[str]:
        """Topics that too few nodes read, with the number of nodes; of images one reader is enough."""
        lacking = []
        played = self._types
        wanted = self._wanted
        for camera in dict.fromkeys(map(_camera_of, played)):
            of_images = [f"/{camera}{ending}" for ending in _IMAGES if f"/{camera}{ending}" in played]
            # A bag may have them raw and compressed; one of the two is enough.
            if of_images and not any(map(self._count_readers, of_images)):
                lacking.append(f"{of_images[0]} (no node)")
            info = f"/{camera}{INFO}"
            if camera not in self._given.image_only and info in played and (n := self._count_readers(info)) < wanted:
                lacking.append(f"{info} ({n} of {wanted} nodes)")
        return lacking

    def _count_readers(self, topic: str) -> int:
        count: int = self._outputs[topic].get_subscription_count()
        return count

    def _wait_for_readers(self, stopped: Callable[[], bool]) -> None:
        given, started_s = self._given, time.monotonic()
        if not given.readers:
            return
        while not stopped() and (lacking := self._lacking()):
            if time.monotonic() - started_s > given.reader_wait:
                raise RecordingError(
                    f"after {given.reader_wait:g} s too few nodes read {few(lacking)}; start the other "
                    "nodes, play only the cameras that they read (-p cameras:=...), or do not wait (-p readers:=0)"
                )
            time.sleep(_SLICE_S)
        settled_s = time.monotonic() + given.settle
        _wait(lambda: settled_s - time.monotonic(), stopped)

    def _play(self, stopped: Callable[[], bool]) -> None:
        """Play the bag from its start to its end."""
        self._count = 0
        self._behind_s = 0.0
        self._started_s = time.monotonic()
        recorded = (bag.messages(topics) for bag, topics in self._sources.items())
        for topic, due_ns, message in merge(*recorded, key=lambda each: each[1]):
            serialized = self._serialized(topic, message)
            self._behind_s = max(self._behind_s, -self._left_s(due_ns))
            _wait(partial(self._left_s, due_ns), stopped)
            if stopped():
                return
            if topic.endswith(_IMAGES):
                self._moments.note(Moment.PLAYED, _camera_of(topic), image_stamp_ns(message))
            self._count += 1
            self._outputs[topic].publish(serialized)
        elapsed_s = time.monotonic() - self._started_s
        self.get_logger().info(
            f"played {self._count} messages in {elapsed_s:.1f} s, at most {self._behind_s:.2f} s behind"
        )

    def _serialized(self, topic: str, message: Message) -> bytes:
        """CDR of a message, with the prefix of the cameras' frames."""
        # A frame of a video has its fields without a header.
        header = message.header if hasattr(message, "header") else message
        header.frame_id = f"{self._prefix}{header.frame_id}"
        return bytes(recording_typestore().serialize_cdr(message, self._types[topic]))

    def _wait_until_received(self, stopped: Callable[[], bool]) -> None:
        deadline_s = time.monotonic() + _LAST_READERS_S
        patience = Duration(nanoseconds=int(1e9 * _SLICE_S))
        while not stopped() and time.monotonic() < deadline_s:
            if all(publisher.wait_for_all_acked(patience) for publisher in self._outputs.values()):
                return

    def _report(self) -> None:
        """Publish the state; warn of missing readers after a while in which a reader may restart."""
        if lacking := self._lacking():
            text = f"{self._state}; too few nodes read {few(lacking)}"
            self.get_logger().warning(text, throttle_duration_sec=_COMPLAINT_S, skip_first=True)
        values: dict[str, object] = {
            "messages played": self._count,
            "time [s]": round(1e-9 * self._now_ns, 1),
            "largest delay [s]": round(self._behind_s, 2),
            "readers lacking": few(lacking) or "none",
        }
        level = StatusLevel.WARN if lacking else StatusLevel.OK
        self._diagnostics.publish([Status(self.get_name(), level, self._state, values)])


def _wait(left_s: Callable[[], float], stopped: Callable[[], bool]) -> None:
    """Wait for the time that is left [s]."""
    while not stopped() and (seconds := left_s()) > 0.0:
        time.sleep(min(seconds, _SLICE_S))


def _camera_of(topic: str) -> str:
    """Name of the camera that a topic belongs to; empty if it belongs to none."""
    for ending in (INFO, TIMING, IMU_TOPIC, *_IMAGES):
        if topic.endswith(ending):
            return topic.removesuffix(ending).removeprefix("/")
    return ""


def make(arguments: Sequence[str] = ()) -> Player:
    """The node."""
    return Player(arguments)
