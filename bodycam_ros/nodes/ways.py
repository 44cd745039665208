"""What passes between computers of how they do: trackers answer for their computer's time, registrations ask for it.

The times of sending and hearing are those that the middleware gives with every message; nothing is added to it.
"""

import socket
import time
import uuid
from collections.abc import Iterable
from functools import partial, wraps
from typing import TYPE_CHECKING, Any, NamedTuple

from rclpy.subscription import Subscription

from bodycam_ros.messages.factory import Message
from bodycam_ros.messages.header import header_message, stamp_ns, time_message
from bodycam_ros.messages.status import Health, HealthLevel
from bodycam_ros.nodes.chrony import chrony_watch
from bodycam_ros.nodes.qos import best_effort
from bodycam_ros.nodes.way_of_messages import WayOfMessages

if TYPE_CHECKING:
    from bodycam_ros.nodes.stage_node import StageNode

_ASKED, _TOLD = "clock_asked", "clock_told"
_QUALITY = best_effort(1)
"""An answer that is sent again tells of the wait for it."""

_LOOK_S, _OFTEN, _SELDOM = 1.0, 10, 5
"""Every second at first, then every fifth: an answer costs 2 ms of processor time."""


class Times(NamedTuple):
    """When a message was sent, by the sender's clock, and when it was heard, by ours [ns].

    One that did not go through the middleware was heard when it was sent: now.
    """

    sent_ns: int
    heard_ns: int

    @classmethod
    def now(cls) -> "Times":
        """Of a message that is delivered within the process."""
        now_ns = time.time_ns()
        return cls(now_ns, now_ns)


def give_times(subscription: Subscription) -> None:
    """Let the callback of a subscription also get the ``Times`` of messages that come through the middleware."""
    callback = subscription.callback

    @wraps(_two_arguments)
    def heard(*arguments: Any) -> None:
        # rclpy 7.1.6's EventsExecutor gives both as one.
        message, info = arguments if len(arguments) > 1 else arguments[0]
        # Not every middleware notes when it heard something.
        callback(message, Times(info["source_timestamp"], info["received_timestamp"] or time.time_ns()))

    subscription.callback = heard


def _two_arguments(message: Message, info: dict[str, int]) -> None:
    """By its arguments rclpy tells who wants to know of times."""


class AnsweredClock:
    """Tells who asks what time it is on the computer of a camera's tracker."""

    def __init__(self, node: "StageNode[Any]", camera: str) -> None:
        self._node = node
        self._told = node.publisher("sensor_msgs/msg/TimeReference", f"{camera}/{_TOLD}", _QUALITY)
        give_times(node.subscription("std_msgs/msg/Header", f"{camera}/{_ASKED}", self._on_asked, _QUALITY))

    def _on_asked(self, asked: Message, times: Times | None = None) -> None:
        make = self._node.make
        header = header_message(make, stamp_ns(asked.stamp), asked.frame_id)
        heard = time_message(make, (times or Times.now()).heard_ns)
        self._told.publish(
            make("sensor_msgs/msg/TimeReference", header=header, time_ref=heard, source=socket.gethostname())
        )

    def values(self) -> dict[str, object]:
        """For ``/diagnostics``."""
        return _own_values()


class Ways:
    """Watches the way of the tracks of some cameras to this node, and asks for the time where they come from."""

    def __init__(self, node: "StageNode[Any]", cameras: Iterable[str]) -> None:
        self._node = node
        self._name = uuid.uuid4().hex
        self._of = {camera: WayOfMessages() for camera in cameras}
        self._asked = {
            camera: node.publisher("std_msgs/msg/Header", f"{camera}/{_ASKED}", _QUALITY) for camera in self._of
        }
        self._rounds = 0
        for camera in self._of:
            on_told = partial(self._on_told, camera)
            give_times(node.subscription("sensor_msgs/msg/TimeReference", f"{camera}/{_TOLD}", on_told, _QUALITY))
        node.every(_LOOK_S, self._ask)

    def came(self, camera: str, times: Times | None) -> None:
        """Tracks of a camera have come."""
        self._of[camera].came(*(times or Times.now()))

    def lost(self, camera: str) -> None:
        """Tracks of a camera have not come."""
        self._of[camera].lost()

    def _ask(self) -> None:
        self._rounds += 1
        if self._rounds > _OFTEN and self._rounds % _SELDOM:
            return
        for publisher in self._asked.values():
            publisher.publish(header_message(self._node.make, time.time_ns(), self._name))

    def _on_told(self, camera: str, told: Message, times: Times | None = None) -> None:
        # Others ask as well.
        if told.header.frame_id == self._name:
            asked_ns, heard_ns = stamp_ns(told.header.stamp), stamp_ns(told.time_ref)
            self._of[camera].answered(told.source, asked_ns, heard_ns, *(times or Times.now()))

    def report(self) -> list[Health]:
        """For ``/diagnostics``: a part for each camera, and one for this computer."""
        here = Health("computer", HealthLevel.OK, f"runs on {socket.gethostname()}", _own_values())
        return [here, *(way.report(f"way of {camera}") for camera, way in self._of.items())]


def _own_values() -> dict[str, object]:
    return {"computer": socket.gethostname(), "clock ahead by chrony": chrony_watch().latest or "unknown"}
