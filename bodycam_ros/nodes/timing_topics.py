"""What the solver publishes about the cameras' clocks: a topic per camera, which late listeners hear too."""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

from bodycam_ros.messages.clocks import TIMING, TIMING_TYPE, timing_messages
from bodycam_ros.nodes.message_classes import is_installed
from bodycam_ros.nodes.qos import latched
from bodycam_ros.nodes.stage_node import StageNode
from bodycam_ros.timing.clock_history import ClockHistory


class TimingTopics:
    """Publishers of ``/<camera>/timing``.

    Args:
        node: publishes.
        cameras: names.
    """

    def __init__(self, node: StageNode[Any], cameras: Iterable[str]) -> None:
        self._make = node.make
        self._publishers = {
            camera: node.publisher(TIMING_TYPE, f"{camera}{TIMING}", latched())
            for camera in cameras
            if is_installed(TIMING_TYPE)
        }
        self._said: dict[str, ClockHistory] = {}

    def publish(self, timings: Mapping[str, ClockHistory]) -> None:
        """Say what has changed: it holds from the stamp on at which it was learned."""
        for camera, timing in timings.items():
            if timing == self._said.get(camera) or camera not in self._publishers:
                continue
            self._said[camera] = timing
            now = replace(timing.latest, since_ns=max(timing.latest.since_ns, timing.latest.at_ns))
            # Of the rows it knows what the registration says; to say it back would make that count twice.
            clock = ClockHistory(camera, (now,))
            for _, message in timing_messages(self._make, clock):
                self._publishers[camera].publish(message)
