"""Stamps that free-running cameras are interpolated to: those of cameras that share theirs, else equally spaced."""

from collections import deque
from collections.abc import Iterable

from bodycam_ros.timing.clock_estimator import ClockEstimator

_SAME_NS = 1_000_000  # stamps of one trigger differ by less
_MISSING_NS = 1_000_000_000  # after so long without cameras that share their stamps, frames are spaced equally


class CommonStamps:
    """Stamps of frames to come, in the body's time [ns], ascending.

    Args:
        clocks: which cameras share their stamps, and how often they take images.
    """

    def __init__(self, clocks: ClockEstimator) -> None:
        self._clocks = clocks
        self._waiting: deque[int] = deque()
        self._latest_ns = self._shared_ns = -1

    def extend(self, stamp_ns: int, is_free: bool) -> None:
        """Add stamps up to that of a registration [ns]; ``is_free``: of a camera that shares its stamps with none."""
        new: Iterable[int] = ()
        if not is_free:
            self._shared_ns = max(self._shared_ns, stamp_ns)
            new = [stamp_ns] if stamp_ns > self._latest_ns + _SAME_NS else ()
        elif (period_ns := self._clocks.shared.period_ns if self._clocks.shared else 0) and (
            not self._clocks.sharing or 0 <= self._shared_ns < stamp_ns - _MISSING_NS
        ):
            if self._latest_ns < 0:
                new = [stamp_ns // period_ns * period_ns]
            else:
                new = range(self._latest_ns + period_ns, stamp_ns + 1, period_ns)
        self._waiting += new
        self._latest_ns = max(self._latest_ns, *new, -1)

    def drop(self, until_ns: int) -> None:
        """Drop the stamps up to one [ns]: their frames are closed."""
        while self._waiting and self._waiting[0] <= until_ns:
            self._waiting.popleft()

    @property
    def first_ns(self) -> int | None:
        """The earliest stamp [ns]; None without one."""
        return self._waiting[0] if self._waiting else None
