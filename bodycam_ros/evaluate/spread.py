"""How values are spread, and how far stamps are from others."""

import numpy as np
from numpy.typing import NDArray


def spread(values: NDArray[np.floating], factor: float = 1.0) -> dict[str, float]:
    """Mean, median, 95th percentile and maximum of values of any shape, times a factor; NaN ones do not count."""
    known = factor * values[np.isfinite(values)]
    if not known.size:
        return dict.fromkeys(("mean", "median", "p95", "max"), np.nan)
    statistics = (known.mean(), np.median(known), np.percentile(known, 95), known.max())
    return dict(zip(("mean", "median", "p95", "max"), map(float, statistics), strict=True))


def distance_in_time(stamps_ns: NDArray[np.int64], others_ns: NDArray[np.int64]) -> NDArray[np.int64]:
    """(K,) distance [ns] of each stamp (K,) to the nearest of others (T,), which increase."""
    after = np.searchsorted(others_ns, stamps_ns)
    next_one = others_ns[np.minimum(after, len(others_ns) - 1)]
    one_before = others_ns[np.maximum(after - 1, 0)]
    distance: NDArray[np.int64] = np.minimum(np.abs(next_one - stamps_ns), np.abs(stamps_ns - one_before))
    return distance
