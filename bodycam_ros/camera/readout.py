"""How long a camera takes to read its rows, as far as it is known."""

import math
from dataclasses import dataclass

LONGEST_READOUT_S = 0.1
"""No camera reads its rows for longer [s]."""

_START_SHARE = 0.45
"""Sigma of a start over the read-out time: other video modes read out some other number of rows."""

_START_S = 0.015
"""The same of a read-out time that is nearly zero: the shutter was global, and that of another mode need not be [s]."""

_NEARLY_ZERO_S = 0.001


@dataclass(frozen=True)
class Readout:
    """A read-out time.

    Attributes:
        seconds: from the exposure of the first row to that of the last [s]; negative from the bottom up, 0 where all
            rows are exposed together.
        sigma: its standard deviation [s]; 0 of one that is given, which nothing changes.
    """

    seconds: float
    sigma: float

    @property
    def is_given(self) -> bool:
        """Whether it is given, not measured."""
        return self.sigma == 0.0

    @property
    def in_use(self) -> float:
        """What pixels are corrected by [s]: zero as long as it cannot be told from zero."""
        return self.seconds if abs(self.seconds) > 2.0 * self.sigma else 0.0

    @property
    def as_start(self) -> "Readout":
        """A start for another recording, maybe in another video mode: hardly known, so that its own images decide."""
        if self.is_given:
            return self
        sigma = _START_S if abs(self.seconds) < _NEARLY_ZERO_S else _START_SHARE * abs(self.seconds)
        return Readout(self.seconds, max(self.sigma, sigma))

    @property
    def milliseconds(self) -> str:
        """For a table in [ms]."""
        return f"{1e3 * self.seconds:.1f} " + ("given" if self.is_given else f"+- {1e3 * self.sigma:.1f}")

    def __str__(self) -> str:
        return f"{1e3 * self.seconds:.1f} ms, given" if self.is_given else f"{self.milliseconds} ms"


def readout_of(seconds: float, sigma: float) -> Readout | None:
    """The read-out time of two numbers of a message; None where either is NaN: it is unknown."""
    return None if math.isnan(seconds) or math.isnan(sigma) else Readout(seconds, sigma)


def best_known(*readouts: Readout | None) -> Readout | None:
    """Of several of one camera the one to begin with: the first that is given, else the best known."""
    known = [readout for readout in readouts if readout is not None]
    return min(known, key=lambda readout: readout.sigma, default=None)
