"""Where a body is at the latest instant, before any later one has improved it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class BodyNow:
    """For those who must know at once, and not as well as what is published.

    Attributes:
        stamp_ns: the instant [ns].
        world_T_segment: (S, 4, 4).
        covariances: (S, 6, 6) of the poses, rotation [rad] then translation [m], in the segments' axes.
        observed: (S,) segments that cameras see.
    """

    stamp_ns: int
    world_T_segment: NDArray[np.float64]
    covariances: NDArray[np.float64]
    observed: NDArray[np.bool_]
