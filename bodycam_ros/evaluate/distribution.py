"""How the values of a measure are spread."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Distribution:
    """Mean, median, 95th percentile and maximum; NaN of no values."""

    mean: float
    median: float
    p95: float
    max: float

    @classmethod
    def of(cls, values: NDArray[np.floating]) -> "Distribution":
        """The distribution of values of any shape; those that are NaN do not count."""
        known = values[np.isfinite(values)]
        if not known.size:
            return cls(np.nan, np.nan, np.nan, np.nan)
        return cls(float(known.mean()), float(np.median(known)), float(np.percentile(known, 95)), float(known.max()))
