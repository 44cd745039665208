"""Images left out under load, live."""

from collections import deque

import numpy as np

_REMEMBERED = 15  # images whose distance in time gives the camera's rate


class EverySecondImage:
    """Decides, image by image, whether it is left out.

    It begins when an image has waited for too long, and ends when for a while none has. Which of two images goes is
    decided by their stamps, not by turns: cameras that trigger together leave out the same ones, and the frames that
    are left have all of them.

    Args:
        recovery_s: how long none may have waited for too long before all images are taken again.

    Attributes:
        active: whether every second image is left out.
    """

    def __init__(self, recovery_s: float) -> None:
        self._recovery_s, self._until_s = recovery_s, 0.0
        self._stamps_ns: deque[int] = deque(maxlen=_REMEMBERED)
        self._slot: int | None = None
        self.active = False

    def leaves_out(self, stamp_ns: int, is_late: bool, now_s: float) -> bool:
        """Whether an image is left out; ask about every image, in order.

        Args:
            stamp_ns: of the image.
            is_late: whether it waited for too long, because others were worked on.
            now_s: on the steady clock.
        """
        if is_late:
            self._until_s = now_s + self._recovery_s
        self.active = now_s < self._until_s
        if self._stamps_ns and stamp_ns <= self._stamps_ns[-1]:
            self._stamps_ns.clear()
        self._stamps_ns.append(stamp_ns)
        if not self.active or len(self._stamps_ns) < 3:
            self._slot = None
            return False
        # A whole number of images a second: two cameras must not differ by what they measure of their rate.
        rate_hz = max(1, round(1e9 / float(np.median(np.diff(self._stamps_ns)))))
        # Stamps that are whole multiples of the interval, but for their rounding, must not lie where slots meet.
        slot = (stamp_ns * rate_hz + 500_000_000) // 2_000_000_000
        second = slot == self._slot
        self._slot = slot
        return second
