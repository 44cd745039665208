"""How the clock of one camera went, and how its rows are read out: what a solved recording says of it."""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera.readout import Readout
from bodycam_ros.timing.clock_state import ClockState

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
