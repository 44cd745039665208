"""How errors are spread, in the words of the paper and in those of the biomechanist."""

from dataclasses import dataclass

import numpy as np

from bodycam_ros.geometry import Array

_WITHIN = 1.96


@dataclass(frozen=True)
class Spread:
    """What A section 5.1 says of errors: mean, median, standard deviation, least and greatest; NaN of no values."""

    mean: float
    median: float
    sd: float
    min: float
    max: float

    @classmethod
    def of(cls, values: Array) -> "Spread":
        """The spread of values of any shape; those that are NaN do not count."""
        known = values[np.isfinite(values)]
        if not known.size:
            return cls(*[np.nan] * 5)
        return cls(*(float(of(known)) for of in (np.mean, np.median, np.std, np.min, np.max)))


@dataclass(frozen=True)
class LimitsOfAgreement:
    """Bland and Altman 1986: the mean difference of two ways to measure, and where 95 % of the differences lie.

    Attributes:
        bias: mean of ours less theirs.
        low, high: bias less and more 1.96 standard deviations.
        rmse: root of the mean square of the differences.
    """

    bias: float
    low: float
    high: float
    rmse: float

    @classmethod
    def of(cls, ours: Array, theirs: Array) -> "LimitsOfAgreement":
        """The agreement of values of the same shape; those that are NaN in either do not count."""
        difference = (ours - theirs)[np.isfinite(ours - theirs)]
        if not difference.size:
            return cls(*[np.nan] * 4)
        bias, sd = float(difference.mean()), float(difference.std())
        return cls(bias, bias - _WITHIN * sd, bias + _WITHIN * sd, float(np.sqrt((difference**2).mean())))
