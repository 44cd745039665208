"""How long a camera takes to read its rows, as far as it is known: a scalar information filter."""

import math
from dataclasses import dataclass

LONGEST_READOUT_S = 0.1
"""No camera reads its rows for longer [s]."""

_START_SHARE = 0.45
"""Sigma of a start over the read-out time: other video modes read out some other number of rows."""

_START_S = 0.015
"""The same of a read-out time that is nearly zero: the shutter was global, and that of another mode need not be [s]."""

_NEARLY_ZERO_S = 0.001

_IMAGES_ALIKE = 6.0  # images share tracks, and so errors; the information of each is divided by this
_SURPRISE = 3.0  # [sigma] an image that differs by more, such as of a foot that lands, is down-weighted by its square
_LEAST_S = 0.0005  # a shorter read-out is taken for none: 2 rad/s move nothing by 0.2 px
_ENOUGH_S = 0.00025  # sigma at which the estimate ends: 4 rad/s move the first row by 0.1 px


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
        least = 0.0 if self.is_given else _LEAST_S
        return self.seconds if abs(self.seconds) > max(least, 2.0 * self.sigma) else 0.0

    @property
    def is_known(self) -> bool:
        """Whether more images would not make it better."""
        return self.sigma < _ENOUGH_S or abs(self.seconds) + 3.0 * self.sigma < _LEAST_S

    def updated(self, seconds: float, information: float) -> "Readout":
        """Return the read-out time updated by the estimate of one image [s], with its information [1/s^2].

        A given read-out time does not change.
        """
        if self.is_given:
            return self
        surprise = abs(seconds - self.seconds) / math.sqrt(1.0 / max(information, 1e-9) + self.sigma**2)
        information *= min(1.0, _SURPRISE / max(surprise, 1e-9)) ** 2 / _IMAGES_ALIKE
        together = self.sigma**-2 + information
        return Readout(self.seconds + information / together * (seconds - self.seconds), together**-0.5)

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


UNKNOWN_READOUT = Readout(0.0, _START_S)
"""Before any image, around zero; cameras take 0 (global shutter) to 30 ms."""


def readout_of(seconds: float, sigma: float) -> Readout | None:
    """The read-out time of two numbers of a message; None where either is NaN: it is unknown."""
    return None if math.isnan(seconds) or math.isnan(sigma) else Readout(seconds, sigma)


def best_known(*readouts: Readout | None) -> Readout | None:
    """The read-out time to begin with, of several of one camera: the first that is given, else the best known."""
    known = [readout for readout in readouts if readout is not None]
    return min(known, key=lambda readout: readout.sigma, default=None)
