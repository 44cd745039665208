"""Which photograph gave a descriptor: a map says only from which side it was seen."""

import math

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.kernels import kernel


@kernel("(f8[:, ::1], i8[::1], f8[:, ::1], f8[:, ::1], i8[::1], i8[::1])")
def givers_of_looks(
    points_world: NDArray[np.float64],
    landmark_of_look: NDArray[np.int64],
    sides: NDArray[np.float64],
    centres: NDArray[np.float64],
    first_observation: NDArray[np.int64],
    observers: NDArray[np.int64],
) -> NDArray[np.int64]:
    """(D,) which photograph gave each look: that which stood most on its side. -1: none.

    Args:
        points_world: (L, 3) landmarks [m].
        landmark_of_look: (D,) their rows.
        sides: (D, 3) unit directions from the landmark to whoever gave the look.
        centres: (K, 3) where photographs were taken [m].
        first_observation, observers: (L + 1,), (O,) the photographs that see each landmark; of (0,), all see all.
    """
    givers = np.empty(len(landmark_of_look), np.int64)
    for look in range(len(landmark_of_look)):
        i = landmark_of_look[look]
        first, last = 0, len(centres)
        if len(observers) > 0:
            first, last = first_observation[i], first_observation[i + 1]
        best, givers[look] = -2.0, -1
        for o in range(first, last):
            k = observers[o] if len(observers) > 0 else o
            x, y, z = (
                centres[k, 0] - points_world[i, 0],
                centres[k, 1] - points_world[i, 1],
                centres[k, 2] - points_world[i, 2],
            )
            cosine = (x * sides[look, 0] + y * sides[look, 1] + z * sides[look, 2]) / math.sqrt(x * x + y * y + z * z)
            if cosine > best:
                best, givers[look] = cosine, k
    return givers
