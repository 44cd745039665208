"""Offset and drift of one camera's clock, now and over a recording."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera.readout import Readout
from bodycam_ros.settings import setting

TRIGGER_SIGMA_S = 2e-4
"""Standard deviation of the clock offset between cameras whose stamps coincide."""

_SIGNIFICANT = 3.0  # sigmas
_LEAST_S = 3e-4  # offsets below this are not reported: triggers are no better
_LEAST_DRIFT = 5e-6
_LEAST_JUMP_S = 0.006  # estimates of one clock before and after a break differ by some milliseconds


@dataclass(frozen=True)
class ClockSettings:
    """Clocks of free-running cameras."""

    sigma: float = setting(
        0.02,
        unit="s",
        limits=(1e-6, 1.0),
        reason="standard deviation of a clock offset before it is estimated; raise it for cameras that are aligned "
        "worse in time than by sound, which leaves some milliseconds and the video delay of one frame",
    )


@dataclass(frozen=True)
class ClockState:
    """One camera's clock, from one stamp on.

    Attributes:
        since_ns: first stamp that it is valid for, by the camera's own clock [ns].
        at_ns: stamp at which the offset is given [ns].
        offset: by how much the camera's stamps are ahead [s].
        drift: growth of the offset per second.
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
        """Lead of the clock at a stamp [ns]."""
        return round(1e9 * (self.offset + self.drift * 1e-9 * (stamp_ns - self.at_ns)))


def clock_at(clocks: Sequence[ClockState], stamp_ns: int) -> ClockState:
    """The clock of some, in order of time, that is valid at a stamp [ns]; the first one extends backwards."""
    return next((clock for clock in reversed(clocks) if clock.since_ns <= stamp_ns), clocks[0])


@dataclass(frozen=True)
class ClockHistory:
    """One camera's clock over a recording.

    Attributes:
        camera: name.
        clocks: in order of ``since_ns``; one more wherever the clock may have been set.
        readout: final estimate of its read-out time; None if it is unknown.
    """

    camera: str
    clocks: tuple[ClockState, ...]
    readout: Readout | None = None

    @property
    def latest(self) -> ClockState:
        """The clock at the end."""
        return self.clocks[-1]

    @property
    def is_off(self) -> bool:
        """Whether the clock is, or ever was, known to differ from that of the recording."""
        return any(
            abs(clock.offset) > max(_LEAST_S, _SIGNIFICANT * clock.offset_sigma)
            or abs(clock.drift) > max(_LEAST_DRIFT, _SIGNIFICANT * clock.drift_sigma)
            for clock in self.clocks
        )

    @property
    def jumps(self) -> list[tuple[int, float]]:
        """When the clock was set, by its own stamps [ns], and by how much it jumped [s]."""
        jumps = []
        for before, after in zip(self.clocks, self.clocks[1:], strict=False):
            by_s = 1e-9 * (after.offset_ns(after.since_ns) - before.offset_ns(after.since_ns))
            if abs(by_s) > max(_LEAST_JUMP_S, _SIGNIFICANT * after.offset_sigma):
                jumps.append((after.since_ns, by_s))
        return jumps

    def corrected_ns(self, stamps_ns: NDArray[np.int64]) -> NDArray[np.int64]:
        """Stamps (N,) of the camera as times of the recording [ns]."""
        ahead_ns = [clock_at(self.clocks, stamp_ns).offset_ns(stamp_ns) for stamp_ns in stamps_ns.tolist()]
        return stamps_ns - np.array(ahead_ns, np.int64)
