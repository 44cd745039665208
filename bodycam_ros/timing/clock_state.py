"""What is known of one camera's clock."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from bodycam_ros.registration.landmark_matches import LandmarkMatches


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


def corrected(matches: LandmarkMatches, clocks: Sequence[ClockState], before: tuple[int, int]) -> LandmarkMatches:
    """With stamps of the recording's time, by the clock that held then.

    Args:
        matches: what an image said.
        clocks: of its camera, in order of time.
        before: the stamp of its image before, as given and as corrected [ns].
    """
    clock = next((clock for clock in reversed(clocks) if clock.since_ns <= matches.stamp_ns), None)
    if clock is None:
        return matches
    previous_ns = matches.previous_stamp_ns
    if previous_ns == before[0]:
        previous_ns = before[1]  # Who looks for that image looks for its stamp, and more may be known of the clock now.
    elif previous_ns:
        previous_ns -= clock.offset_ns(previous_ns)
    return replace(
        matches, stamp_ns=matches.stamp_ns - clock.offset_ns(matches.stamp_ns), previous_stamp_ns=previous_ns
    )
