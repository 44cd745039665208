"""Where in a recording a player is: time that runs at a rate, stands still, and goes on. No ROS."""

import math
import time


class PlayedTime:
    """The clock of a recording that is played.

    Args:
        rate: times the speed at which it was recorded.
        is_paused: whether it stands still at first.

    Attributes:
        is_paused: whether it stands still.
    """

    def __init__(self, rate: float, is_paused: bool = False) -> None:
        self._rate = rate
        self.is_paused = is_paused
        self._at_ns = 0
        self._since_s = time.monotonic()
        self._steps = 0

    @property
    def now_ns(self) -> int:
        """Where it is [ns]."""
        if self.is_paused:
            return self._at_ns
        return self._at_ns + round(1e9 * self._rate * (time.monotonic() - self._since_s))

    def go_to(self, at_ns: int) -> None:
        """Go on from somewhere else."""
        self._at_ns, self._since_s = at_ns, time.monotonic()

    def pause(self) -> None:
        """Stand still."""
        self.go_to(self.now_ns)
        self.is_paused = True

    def resume(self) -> None:
        """Go on."""
        self.go_to(self.now_ns)
        self.is_paused, self._steps = False, 0

    def set_rate(self, rate: float) -> None:
        """Go on at another rate."""
        self.go_to(self.now_ns)
        self._rate = rate

    def step(self) -> bool:
        """Play what is due next, while it stands still; False where it does not."""
        self._steps += self.is_paused
        return self.is_paused

    def left_s(self, due_ns: int) -> float:
        """How long it takes until something is due [s]; without end while it stands still before that."""
        left_ns = due_ns - self.now_ns
        return math.inf if self.is_paused and left_ns > 0 else 1e-9 * left_ns / self._rate

    def left_or_step_s(self, due_ns: int) -> float:
        """The same; a step that was asked for goes there."""
        if self._steps and self.is_paused and self.left_s(due_ns) > 0.0:
            self._steps -= 1
            self.go_to(due_ns)
        return self.left_s(due_ns)
