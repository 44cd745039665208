"""How the messages of one camera fare on their way from its computer: whether they are whole, how late, by which clock.

Imports no ROS.
"""

from collections import deque

import numpy as np

from bodycam_ros.messages.status import Health, HealthLevel
from bodycam_ros.nodes.clock_of_other import ClockOfOther

_KEPT = 300
"""Delays: those of ten seconds."""

_CLOCKS_AGREE_S = 0.005
"""A hand that moves with 2 m/s is 1 cm elsewhere by then."""


class WayOfMessages:
    """Counts what came and what did not.

    Attributes:
        computer: where the camera's messages come from; empty until it has answered.
        clock: of that computer.
    """

    def __init__(self) -> None:
        self._delays_s: deque[float] = deque(maxlen=_KEPT)
        self._came, self._lost, self._lost_before = 0, 0, 0
        self.computer = ""
        self.clock = ClockOfOther()

    def came(self, sent_ns: int, heard_ns: int) -> None:
        """A message has come.

        Args:
            sent_ns: when it was sent, by the sender's clock.
            heard_ns: when it arrived, by ours.
        """
        self._came += 1
        self._delays_s.append(1e-9 * (heard_ns - sent_ns))

    def lost(self) -> None:
        """One or several in a row did not come, as the next has told."""
        self._lost += 1

    def answered(self, computer: str, asked_ns: int, heard_ns: int, told_ns: int, answered_ns: int) -> None:
        """The computer has answered a question for its time; as ``ClockOfOther.add``."""
        if computer != self.computer:
            self.computer = computer
            self.clock.forget()
        self.clock.add(asked_ns, heard_ns, told_ns, answered_ns)

    def report(self, name: str) -> Health:
        """How they fared since the last call of this, under a name."""
        came, self._came = self._came, 0
        lately, self._lost_before = self._lost - self._lost_before, self._lost
        ahead = self.clock.ahead
        values: dict[str, object] = {
            "computer": self.computer or "unknown",
            "messages per second": came,
            "times lost": self._lost,
            **self._delay(),
            "clock ahead by [ms]": f"{1e3 * ahead.seconds:.2f}" if ahead else "unknown",
            "clock ahead known to [ms]": f"{1e3 * ahead.bound:.2f}" if ahead else "unknown",
        }
        if ahead and abs(ahead.seconds) - ahead.bound > _CLOCKS_AGREE_S:
            side = "ms ahead of" if ahead.seconds > 0.0 else "ms behind"
            text = (
                f"the clock of {self.computer} is {abs(1e3 * ahead.seconds):.1f} {side} this computer's, and so may be "
                "the stamps of its cameras; synchronise both (chrony)"
            )
            return Health(name, HealthLevel.WARN, text, values)
        if lately:
            return Health(name, HealthLevel.WARN, f"messages were lost on the way {lately} times", values)
        return Health(name, HealthLevel.OK, "messages come whole" if came else "no messages come", values)

    def _delay(self) -> dict[str, object]:
        """By one clock, as far as the other's is known."""
        if not self._delays_s:
            return {"delay, median [ms]": "none", "delay, 99 % [ms]": "none"}
        ahead = self.clock.ahead
        delays_ms = 1e3 * (np.array(self._delays_s) + (ahead.seconds if ahead else 0.0))
        median, most = np.percentile(delays_ms, (50.0, 99.0))
        return {"delay, median [ms]": f"{median:.2f}", "delay, 99 % [ms]": f"{most:.2f}"}
