"""Node ``player``: publishes the cameras of a bag, without ``ros2 bag play``, and without loss.

It starts once all readers have subscribed, so that the graph gets the first image too. Stamps stay as recorded.
"""

import threading
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from rclpy.clock import Clock, ClockType
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.qos_overriding_options import QoSOverridingOptions

from bodycam_ros.errors import RecordingError
from bodycam_ros.live.dropped_messages import DroppedMessages
from bodycam_ros.live.node_parameters import PlayerParameters
from bodycam_ros.live.playback import IMAGES, LATCHED, Playback, camera_of
from bodycam_ros.messages.diagnostics import few
from bodycam_ros.messages.factory import time_message
from bodycam_ros.messages.images import COMPRESSED_VIDEO
from bodycam_ros.moments import Moment, Moments
from bodycam_ros.nodes.parameters import (
    STAGE_DEPTH,
    NodeParameters,
    is_installed,
    latched,
    message_class,
    node_messages,
    reliable,
)
from bodycam_ros.nodes.process import spin
from bodycam_ros.nodes.stage_node import Diagnostics, frame_prefix

_CLOCK = "rosgraph_msgs/msg/Clock"

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
        self._lacking_since_s: float | None = None

    def work(self, stopped: Callable[[], bool]) -> None:
        """Wait for readers, play the bag, and wait until all is acknowledged."""
        warn, has_video = self.get_logger().warning, is_installed(COMPRESSED_VIDEO)
        self._playback = Playback(self._path, self._given, self._prefix, has_video, DroppedMessages(warn), warn)
        self._outputs = {topic: self._publisher(topic, kind) for topic, kind in self._playback.played.items()}
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(_REPORT_S, self._report, clock=steady)
        if self._given.clock > 0.0:
            clock = self.create_publisher(message_class(_CLOCK), "/clock", reliable(1))
            self.create_timer(1.0 / self._given.clock, lambda: clock.publish(self._clock_message()), clock=steady)
        is_over = threading.Event()
        server = threading.Thread(target=spin, args=(self, is_over.is_set))
        server.start()
        try:
            with self._playback:
                self._wait_for_readers(stopped)
                self._state, self._wanted = "playing", 1
                while not stopped():
                    self._play(stopped)
                    if not self._given.loop or not self._playback.count:
                        break
            self._wait_until_received(stopped)
        finally:
            is_over.set()
            server.join()

    def finish(self) -> None:
        """Write the times at which frames were published."""
        self._moments.write()

    def _publisher(self, topic: str, kind: str) -> Any:
        quality = latched() if topic.endswith(LATCHED) else reliable(STAGE_DEPTH)
        options = QoSOverridingOptions.with_default_policies()
        # In the node's namespace, as a camera's driver would.
        name = topic.lstrip("/")
        return self.create_publisher(message_class(kind), name, quality, qos_overriding_options=options)

    def _clock_message(self) -> Any:
        return self._make(_CLOCK, clock=time_message(self._make, self._playback.now_ns))

    def _count_readers(self, topic: str) -> int:
        """Number of connected nodes; a node may have several subscriptions."""
        if not self._outputs[topic].get_subscription_count():
            return 0
        known = self.get_subscriptions_info_by_topic(self.resolve_topic_name(topic.lstrip("/")))
        return len({(reader.node_namespace, reader.node_name) for reader in known})

    def _wait_for_readers(self, stopped: Callable[[], bool]) -> None:
        given, started_s = self._given, time.monotonic()
        if not given.readers:
            return
        while not stopped() and (lacking := self._playback.lacking(given.readers, self._count_readers)):
            if time.monotonic() - started_s > given.reader_wait:
                raise RecordingError(
                    f"after {given.reader_wait:g} s too few nodes read {few(lacking)}; start the other "
                    "nodes, play only the cameras that they read (-p cameras:=...), or do not wait (-p readers:=0)"
                )
            time.sleep(_SLICE_S)
        settled_s = time.monotonic() + given.settle
        _wait(lambda: settled_s - time.monotonic(), stopped)

    def _play(self, stopped: Callable[[], bool]) -> None:
        started_s = time.monotonic()
        playback = self._playback
        for due_ns, topic, stamp_ns, serialized in playback.messages():
            _wait(partial(playback.left_s, due_ns), stopped)
            if stopped():
                return
            if topic.endswith(IMAGES):
                self._moments.note(Moment.PLAYED, camera_of(topic), stamp_ns)
            self._outputs[topic].publish(serialized)
        elapsed_s = time.monotonic() - started_s
        self.get_logger().info(
            f"played {playback.count} messages in {elapsed_s:.1f} s, at most {playback.behind_s:.2f} s behind"
        )

    def _wait_until_received(self, stopped: Callable[[], bool]) -> None:
        deadline_s = time.monotonic() + _LAST_READERS_S
        patience = Duration(nanoseconds=int(1e9 * _SLICE_S))
        while not stopped() and time.monotonic() < deadline_s:
            if all(publisher.wait_for_all_acked(patience) for publisher in self._outputs.values()):
                return

    def _report(self) -> None:
        """Publish the state; warn of missing readers after a while in which a reader may restart."""
        now_s, lacking = time.monotonic(), self._playback.lacking(self._wanted, self._count_readers)
        self._lacking_since_s = (self._lacking_since_s or now_s) if lacking else None
        if self._lacking_since_s is not None and now_s - self._lacking_since_s > _COMPLAINT_S:
            text = f"{self._state}; too few nodes read {few(lacking)}"
            self.get_logger().warning(text, throttle_duration_sec=_COMPLAINT_S)
        self._diagnostics.publish([self._playback.report(self.get_name(), self._state, lacking)])


def _wait(left_s: Callable[[], float], stopped: Callable[[], bool]) -> None:
    """Wait for the time that is left [s]."""
    while not stopped() and (seconds := left_s()) > 0.0:
        time.sleep(min(seconds, _SLICE_S))


def make(arguments: Sequence[str] = ()) -> Player:
    """The node."""
    return Player(arguments)
