"""One time for cameras whose clocks may be apart, or be set while they run."""

from typing import Final

_LONGEST_NS: Final = 10_000_000_000
"""What seems to be a longer pause may be a clock that was set: so much of it counts."""


class SteadyTime:
    """Time that passes as the cameras' stamps do, and never goes back.

    Attributes:
        now_ns: since the first image [ns].
    """

    def __init__(self) -> None:
        self.now_ns = 0
        self._latest_ns: dict[str, int] = {}
        self._passed_ns: dict[str, int] = {}

    def at(self, camera: str, stamp_ns: int) -> int:
        """The time of a camera's image [ns]; a camera that is new joins at the present."""
        before_ns = self._latest_ns.get(camera)
        if before_ns is None:
            self._passed_ns[camera] = self.now_ns
        else:
            self._passed_ns[camera] += min(max(0, stamp_ns - before_ns), _LONGEST_NS)
        self._latest_ns[camera] = stamp_ns
        self.now_ns = max(self.now_ns, self._passed_ns[camera])
        return self._passed_ns[camera]
