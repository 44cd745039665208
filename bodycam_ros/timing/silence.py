"""Live, a time without images of any camera, by the stamps of inertial sensors that go on."""

import time
from collections import deque
from collections.abc import Callable

_QUIET_S, _STEP_S = 0.1, 0.02  # of real time without registrations; of it so much counts between two samples
_WAIT_NS, _WAIT_FRAMES, _WAIT_DELAYS = 50_000_000, 2.5, 2.0  # without registrations, before cameras count as silent
_BEHIND_FRAMES, _BEHIND_DELAYS = 1.0, 1.2  # by which states are behind samples from then on
_STALL_NS = 500_000_000  # without registrations: longer, images that are taken are not waited for
_RECENT_NS = 500_000_000  # of registrations whose delays count: at first they are late by a second and more


class Silence:
    """Finds within one epoch that all cameras are silent, and up to when states are due without them.

    A registration comes after an inertial sample of the same time, by as much as its image takes on its way. By the
    largest recent delay, silence is distinguished from images that are still on their way; states without images are as
    far behind samples as with them, so that images that come again are not late (``Arrivals``). A process that stood
    still receives samples and registrations in bursts, in any order, so silence lasts for some real time too, in which
    samples keep coming. Where registrations stall, as on an overloaded machine, drivers still publish a camera_info
    with each image: such images are waited for.

    Args:
        steady_s: the steady clock [s].

    Attributes:
        message_ns: latest stamp of a message [ns]; -1 before the first.
    """

    def __init__(self, steady_s: Callable[[], float] = time.monotonic) -> None:
        self._steady_s = steady_s
        self._sensed_ns = self._taken_ns = self.message_ns = -1
        self._quiet_s = self._sensed_s = 0.0
        # Stamp and delay [ns] of registrations, of which none later has a larger delay: the first is the largest.
        self._delays: deque[tuple[int, int]] = deque()

    def add_message(self, stamp_ns: int) -> None:
        """A message of a camera, with its stamp in the body's time [ns]."""
        if self._sensed_ns >= 0:
            delay_ns = max(self._sensed_ns - stamp_ns, 0)
            while self._delays and self._delays[-1][1] <= delay_ns:
                self._delays.pop()
            self._delays.append((stamp_ns, delay_ns))
            while self._delays[0][0] < stamp_ns - _RECENT_NS:
                self._delays.popleft()
        self.message_ns = max(self.message_ns, stamp_ns)
        self._quiet_s = 0.0

    def add_image(self, stamp_ns: int) -> None:
        """An image was taken, whose registration is still to come."""
        self._taken_ns = max(self._taken_ns, stamp_ns)

    def add_sample(self, stamp_ns: int) -> None:
        """An inertial sample, with its stamp in the body's time [ns]."""
        now_s = self._steady_s()
        self._quiet_s += min(now_s - self._sensed_s, _STEP_S)
        self._sensed_ns, self._sensed_s = stamp_ns, now_s

    def due_ns(self, period_ns: float) -> float | None:
        """Time up to which states are due without images [ns]; None while there are images.

        Args:
            period_ns: of the states [ns]; infinite before it is known.
        """
        if self.message_ns < 0 or self._quiet_s < _QUIET_S:
            return None
        delay_ns = self._delays[0][1] if self._delays else 0
        wait_ns = _WAIT_NS + _WAIT_FRAMES * period_ns + _WAIT_DELAYS * delay_ns
        latest_ns = max(self.message_ns, min(self._taken_ns, self.message_ns + _STALL_NS))
        if self._sensed_ns - latest_ns <= wait_ns:
            return None
        return self._sensed_ns - _BEHIND_FRAMES * period_ns - _BEHIND_DELAYS * delay_ns
