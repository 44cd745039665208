"""A player's clock as others see it: ``/clock``, and services to pause it, named as those of rosbag2's player."""

import time
from typing import Any

from bodycam_ros.messages.header import time_message
from bodycam_ros.nodes.played_time import PlayedTime
from bodycam_ros.nodes.player_parameters import PlayerParameters
from bodycam_ros.nodes.qos import reliable
from bodycam_ros.nodes.stage_node import StageNode

CLOCK, CLOCK_TYPE = "/clock", "rosgraph_msgs/msg/Clock"


class Playback:
    """Time of a recording that is played, told and controlled.

    Args:
        node: the player.

    Attributes:
        time: where it is in the recording.
    """

    def __init__(self, node: StageNode[PlayerParameters]) -> None:
        of = node.parameters
        self.time = PlayedTime(of.rate, of.start_paused)
        self._make, self._log = node.make, node.get_logger()
        self._steps = 0
        self._interval_s = 1.0 / of.clock if of.clock else 0.0
        self._said_s = -self._interval_s
        # Reliable, so that those who ask for that hear it as well as those who do not.
        self._clock: Any = node.publisher(CLOCK_TYPE, CLOCK, reliable(1)) if of.clock else None
        node.trigger("~/pause", lambda: self._pause(True))
        node.trigger("~/resume", lambda: self._pause(False))
        node.trigger("~/toggle_paused", lambda: self._pause(not self.time.is_paused))
        node.trigger("~/is_paused", lambda: (self.time.is_paused, self._state))
        node.trigger("~/play_next", self._play_next)

    @property
    def _state(self) -> str:
        return "paused" if self.time.is_paused else "playing"

    def begin(self, start_ns: int) -> None:
        """Go to where a recording starts [ns]; while it is paused nothing is due there."""
        self.time.go_to(start_ns - 1)

    def left_s(self, due_ns: int) -> float:
        """How long until something is due [s]; at once where somebody asks for the next."""
        if self._steps and self.time.is_paused and self.time.left_s(due_ns) > 0.0:
            self._steps -= 1
            self.time.go_to(due_ns)
        return self.time.left_s(due_ns)

    def tell(self) -> float:
        """Publish what time it is, if it is time to; how long until it is again [s]."""
        if self._clock is None:
            return 1.0
        left_s = self._said_s + self._interval_s - time.monotonic()
        if left_s <= 0.0:
            self._said_s = time.monotonic()
            self._clock.publish(self._make(CLOCK_TYPE, clock=time_message(self._make, self.time.now_ns)))
            return self._interval_s
        return left_s

    def _pause(self, wanted: bool) -> tuple[bool, str]:
        if wanted != self.time.is_paused:
            self._steps = 0
            (self.time.pause if wanted else self.time.resume)()
            self._log.info(self._state)
        return True, self._state

    def _play_next(self) -> tuple[bool, str]:
        if not self.time.is_paused:
            return False, "it is playing; pause it first"
        self._steps += 1
        return True, "plays what was recorded next"
