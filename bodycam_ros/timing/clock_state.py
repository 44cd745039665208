"""What is known of one camera's clock."""

from dataclasses import dataclass


@dataclass(frozen=True)
class ClockState:
    """One camera's clock, from one stamp on.

    Attributes:
        since_ns: first stamp that it holds for, by the camera's own clock [ns].
        at_ns: stamp at which the offset holds [ns].
        offset: by how much the camera's stamps are ahead [s].
        drift: by which that grows per second.
        offset_sigma: [s].
        drift_sigma: [s/s].
    """

    since_ns: int
    at_ns: int
    offset: float
    drift: float
    offset_sigma: float
    drift_sigma: float

    def offset_ns(self, stamp_ns: int) -> int:
        """By how much the clock is ahead at a stamp [ns]."""
        return round(1e9 * (self.offset + self.drift * 1e-9 * (stamp_ns - self.at_ns)))


@dataclass(frozen=True)
class ClockJump:
    """A clock that jumped: which, when by its own stamps [ns], and by how much [s]."""

    camera: str
    stamp_ns: int
    by_s: float
