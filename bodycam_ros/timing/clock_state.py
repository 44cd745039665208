"""What is known of one camera's clock."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera.readout import Readout
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.settings import setting


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


@dataclass(frozen=True)
class ClockSettings:
    """Clocks of cameras that were started by hand."""

    rate: float = setting(
        0.0,
        unit="Hz",
        limits=(0.0, 480.0),
        reason="instants of the body per second; 0: those that most cameras share, or else as many as they have images",
    )
    sigma: float = setting(
        0.02,
        unit="s",
        limits=(1e-6, 1.0),
        reason="how far a clock that nothing triggers with the others may be off: sound is some milliseconds off, and "
        "pictures may lag a frame behind it",
    )
    trigger_sigma: float = setting(
        0.0002, unit="s", limits=(1e-6, 0.1), reason="the same of cameras whose stamps are those of the others"
    )
    drift_sigma: float = setting(
        1e-4,
        limits=(0.0, 0.01),
        reason="seconds per second; quartz is good to 20 ppm, to 50 when it is cold, and 100 must not be held back",
    )
    drift_walk: float = setting(
        4e-8, limits=(0.0, 1e-4), reason="by how much a drift changes in a second: 1 ppm in ten minutes as cameras warm"
    )
    window: float = setting(
        4.0,
        unit="s",
        limits=(0.5, 60.0),
        reason="clocks are asked once in this time: 2 s left 2.7 ms where 4 s left 1.8; a jump shows in any case",
    )
    lookahead: float = setting(
        8.0,
        unit="s",
        limits=(0.0, 600.0),
        reason="offline, how far ahead of the body clocks are learned; four seconds of walking tell them to 2 or 3 ms",
    )
    instants: float = setting(
        10.0,
        unit="Hz",
        limits=(1.0, 100.0),
        reason="instants of a window at which cameras are compared; neighbours share their errors",
    )
    instants_alike: float = setting(
        6.0, limits=(1.0, 100.0), reason="neighbouring instants that say the same, because tracks keep their errors"
    )
    jump: float = setting(
        0.006,
        unit="s",
        limits=(0.0005, 10.0),
        reason="set by less, a clock is not said to have jumped; off by more and by five sigmas, it is learned anew",
    )
    max_gap: float = setting(
        0.12,
        unit="s",
        limits=(0.01, 1.0),
        reason="a camera's pose is read off its path between two images this close; beyond, limbs do what they like",
    )
    settled: float = setting(
        0.001, unit="s", limits=(1e-6, 0.1), reason="clocks that moved by less are not used to find a body anew"
    )
    turns: int = setting(3, limits=(1, 10), reason="how often a body is found anew with clocks that moved")


_SIGNIFICANT = 3.0
_LEAST_S = 3e-4
"""Clocks that are off by less are called right: triggers are no better."""

_LEAST_DRIFT = 5e-6


@dataclass(frozen=True)
class ClockHistory:
    """One camera's clock over a recording.

    Attributes:
        camera: name.
        clocks: in order of ``since_ns``; one more for each time that it was set, or that more was known.
        readout_time: from the first row's exposure to the last's [s]; NaN if nobody knows.
        readout_sigma: its standard deviation [s]; 0 if it was given.
    """

    camera: str
    clocks: tuple[ClockState, ...]
    readout_time: float = math.nan
    readout_sigma: float = math.nan

    @property
    def latest(self) -> ClockState:
        """The clock at the end."""
        return self.clocks[-1]

    @property
    def is_off(self) -> bool:
        """Whether the clock is, or ever was, known not to be that of the recording."""
        return any(
            abs(clock.offset) > max(_LEAST_S, _SIGNIFICANT * clock.offset_sigma)
            or abs(clock.drift) > max(_LEAST_DRIFT, _SIGNIFICANT * clock.drift_sigma)
            for clock in self.clocks
        )

    def with_readout(self, readout: Readout | None) -> "ClockHistory":
        """With what is known in the end of how the camera's rows are read out, if anything is."""
        if readout is None:
            return self
        return replace(self, readout_time=readout.seconds, readout_sigma=readout.sigma)

    def corrected_ns(self, stamps_ns: NDArray[np.int64]) -> NDArray[np.int64]:
        """Stamps (N,) of the camera as times of the recording [ns]; what came before the first clock goes by it."""
        since_ns = np.array([clock.since_ns for clock in self.clocks], np.int64)
        rows = np.maximum(np.searchsorted(since_ns, stamps_ns, side="right") - 1, 0)
        offsets_s, drifts = (np.array([getattr(c, name) for c in self.clocks]) for name in ("offset", "drift"))
        at_ns = np.array([clock.at_ns for clock in self.clocks], np.int64)
        ahead_s = offsets_s[rows] + drifts[rows] * 1e-9 * (stamps_ns - at_ns[rows])
        corrected: NDArray[np.int64] = stamps_ns - np.round(1e9 * ahead_s).astype(np.int64)
        return corrected
