"""Node ``player``: publishes the cameras of a bag, without ``ros2 bag play``, and without loss.

It starts once all readers have subscribed, so that the graph gets the first image too. Stamps stay as recorded.
"""

import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.qos_overriding_options import QoSOverridingOptions
from rclpy.task import Future
from std_srvs.srv import Trigger

from bodycam_ros.errors import RecordingError
from bodycam_ros.live.dropped_messages import DroppedMessages
from bodycam_ros.live.node_parameters import PlayerParameters
from bodycam_ros.live.playback import IMAGES, INFO, TIMING, Playback, PlayedTime, camera_of
from bodycam_ros.messages.diagnostics import few
from bodycam_ros.messages.factory import Message, time_message
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
from bodycam_ros.nodes.process import light_executor
from bodycam_ros.nodes.stage_node import Diagnostics, frame_prefix
from bodycam_ros.recording.typestore import COMPRESSED_VIDEO

_CLOCK = "rosgraph_msgs/msg/Clock"

_SLICE_S = 0.1
"""Longest delay before the player stops on request."""

_SHORT_S = 0.02
_REPORT_S, _COMPLAINT_S = 1.0, 5.0
_LAST_READERS_S = 30.0


class Player(Node):
    """Publishes a bag's images and camera_info at a multiple of the speed at which they were recorded.

    It can be paused, stepped, and given another rate while it plays; its services are named as those of rosbag2's
    player. It is not a managed node: it ends with the bag.
    """

    def __init__(self, arguments: Sequence[str] = ()) -> None:
        super().__init__(
            "player",
            cli_args=[*arguments],
            automatically_declare_parameters_from_overrides=True,
            enable_logger_service=True,
        )

    def bring_up(self) -> None:
        """Read the parameters; raises SettingsError where one is wrong."""
        self.parameters: NodeParameters[PlayerParameters] = NodeParameters(self, PlayerParameters)
        of = self.parameters.own
        self._path = Path(self.parameters.required("bagfile"))
        self.parameters.is_configured = True
        self._prefix = frame_prefix(self, of.frame_prefix)
        self._make = node_messages(self._prefix)
        self._diagnostics = Diagnostics(self, self._make)
        self._moments = Moments(Path(of.moments) if of.moments else None)
        self._time = PlayedTime(of.rate, of.start_paused)
        self.parameters.on_change(lambda: self._time.set_rate(self.parameters.own.rate))
        clock = of.clock > 0.0
        self._clock_publisher = self.create_publisher(message_class(_CLOCK), "/clock", reliable(1)) if clock else None
        self._clock_due_s = self._served_s = self._report_due_s = self._complaint_due_s = 0.0
        self._unread_since_s: float | None = None
        for name, callback in {
            "pause": lambda: self._pause(True),
            "resume": lambda: self._pause(False),
            "toggle_paused": lambda: self._pause(not self._time.is_paused),
            "is_paused": lambda: (self._time.is_paused, self._state),
            "play_next": self._play_next,
        }.items():
            self.create_service(Trigger, f"~/{name}", partial(_answer, callback))

    def work(self, stopped: Callable[[], bool]) -> None:
        """Wait for readers, play the bag, and wait until all is acknowledged."""
        self._spinner = light_executor()
        self._spinner.add_node(self)
        log, of, has_video = self.get_logger(), self.parameters.own, is_installed(COMPRESSED_VIDEO)
        dropped = DroppedMessages(log.warning)
        try:
            with Playback(self._path, of, self._time, self._prefix, has_video, dropped, log.warning) as playback:
                self._playback = playback
                self._outputs = {topic: self._publisher(topic, kind) for topic, kind in playback.played.items()}
                self._wait_for_readers(stopped)
                while not stopped():
                    self._play(stopped)
                    if not self.parameters.own.loop or not playback.count:
                        break
            self._wait_until_received(stopped)
        finally:
            self._spinner.remove_node(self)
            self._spinner.shutdown()

    def finish(self) -> None:
        """Write the times at which frames were published."""
        self._moments.write()

    def _publisher(self, topic: str, kind: str) -> Any:
        quality = latched() if topic.endswith((INFO, TIMING)) else reliable(STAGE_DEPTH)
        options = QoSOverridingOptions.with_default_policies()
        # In the node's namespace, as a camera's driver would.
        name = topic.lstrip("/")
        return self.create_publisher(message_class(kind), name, quality, qos_overriding_options=options)

    def _lacking(self, readers: int) -> list[str]:
        return self._playback.lacking(
            readers, lambda topic: self._outputs[topic].get_subscription_count(), partial(self._readers, readers)
        )

    def _readers(self, wanted: int, topic: str) -> int:
        """Number of connected nodes, at most the wanted one; a node may have several subscriptions."""
        if not self._outputs[topic].get_subscription_count():
            return 0
        known = self.get_subscriptions_info_by_topic(self.resolve_topic_name(topic.lstrip("/")))
        return min(wanted, len({(reader.node_namespace, reader.node_name) for reader in known}))

    def _wait_for_readers(self, stopped: Callable[[], bool]) -> None:
        of = self.parameters.own
        if not of.readers:
            return
        started_s = time.monotonic()
        while not stopped() and (lacking := self._lacking(of.readers)):
            waited_s = time.monotonic() - started_s
            if waited_s > of.reader_wait:
                raise RecordingError(
                    f"after {of.reader_wait:g} s too few nodes read {few(lacking)}; start the other "
                    "nodes, play only the cameras that they read (-p cameras:=...), or do not wait (-p readers:=0)"
                )
            if waited_s > _COMPLAINT_S:
                self._complain(lacking, f"waits until {of.readers} nodes read each camera; lacking are")
            self._report("waiting for readers", lacking)
            self._publish_clock()
            self._serve(_SLICE_S)
        settled_s = time.monotonic() + of.settle
        self._wait(lambda: settled_s - time.monotonic(), stopped)

    def _play(self, stopped: Callable[[], bool]) -> None:
        started_s = time.monotonic()
        playback = self._playback
        for due_ns, topic, stamp_ns, serialized in playback.messages():
            self._wait(partial(self._time.left_or_step_s, due_ns), stopped)
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

    def _wait(self, left: Callable[[], float], stopped: Callable[[], bool]) -> None:
        """Serve requests, and publish clock and diagnostics, for the time that is left [s]; at least once."""
        while not stopped():
            self._report_unread()
            clock_s, left_s = self._publish_clock(), left()
            if left_s > 0.0 or time.monotonic() - self._served_s > _SLICE_S:
                self._serve(max(0.0, min(left_s, clock_s, _SLICE_S)))
            if left_s <= 0.0:
                return

    def _serve(self, seconds: float) -> None:
        """Wait and answer requests; not in every short wait, which would cost more than the message."""
        if seconds < _SHORT_S and time.monotonic() - self._served_s < _SLICE_S:
            time.sleep(seconds)
            return
        self._spinner.spin_until_future_complete(Future(), seconds)
        self._served_s = time.monotonic()

    def _publish_clock(self) -> float:
        """Publish /clock if it is due; return the time until it is due again [s]."""
        if self._clock_publisher is None:
            return 1.0
        left_s = self._clock_due_s - time.monotonic()
        if left_s <= 0.0:
            left_s = 1.0 / self.parameters.own.clock
            self._clock_due_s = time.monotonic() + left_s
            self._clock_publisher.publish(self._make(_CLOCK, clock=time_message(self._make, self._time.now_ns)))
        return left_s

    def _report_unread(self) -> None:
        """Report topics without readers, after a while in which a reader may restart."""
        now_s = time.monotonic()
        if now_s < self._report_due_s:
            return
        unread = self._lacking(1)
        self._unread_since_s = (self._unread_since_s or now_s) if unread else None
        if self._unread_since_s is not None and now_s - self._unread_since_s > _COMPLAINT_S:
            self._complain(unread, "plays, but these topics have no readers:")
        self._report(self._state, unread)

    def _complain(self, lacking: Sequence[str], text: str) -> None:
        if time.monotonic() > self._complaint_due_s:
            self._complaint_due_s = time.monotonic() + _COMPLAINT_S
            self.get_logger().warning(f"{text} {few(lacking)}")

    def _report(self, text: str, lacking: Sequence[str]) -> None:
        if time.monotonic() >= self._report_due_s:
            self._report_due_s = time.monotonic() + _REPORT_S
            self._diagnostics.publish([self._playback.report(self.get_name(), text, lacking)])

    @property
    def _state(self) -> str:
        return "paused" if self._time.is_paused else "playing"

    def _pause(self, wanted: bool) -> tuple[bool, str]:
        if wanted != self._time.is_paused:
            (self._time.pause if wanted else self._time.resume)()
            self.get_logger().info(self._state)
        return True, self._state

    def _play_next(self) -> tuple[bool, str]:
        is_step = self._time.step()
        return is_step, "plays what was recorded next" if is_step else "it is playing; pause it first"


def _answer(callback: Callable[[], tuple[bool, str]], request: Message, response: Message) -> Message:
    response.success, response.message = callback()
    return response


def make(arguments: Sequence[str] = ()) -> Player:
    """The node."""
    return Player(arguments)
