"""What one round of registration over a recording brought."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class ExtensionRound:
    """One round.

    Attributes:
        backwards: whether it went from the recording's end to its start.
        shares: camera -> share of its images that are registered, in this round or before.
        share: the same of all images.
        absolute: share of all images that landmarks of the photographs were enough to hold, whatever helped to find
            them; later rounds have fewer, because cameras then prefer landmarks that their own kind has seen.
        landmarks: that the map had grown by.
        places: camera -> (N, 3) where its registered images were taken [m].
    """

    backwards: bool
    shares: Mapping[str, float]
    share: float
    absolute: float
    landmarks: int
    places: Mapping[str, NDArray[np.float64]]
