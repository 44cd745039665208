"""Settings of map extension by body cameras, live and in rounds over a recording, and what each round achieved."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.settings import setting


@dataclass(frozen=True)
class GrowthSettings:
    """Map extension while cameras are registered (A 4.1, second half)."""

    enabled: bool = setting(True, reason="body cameras add landmarks where the photographs show none")
    capacity: int = setting(
        12000,
        unit="landmarks",
        limits=(100, 1_000_000),
        reason="most added landmarks at a time; those unobserved for longest are removed first. More costs memory",
    )


@dataclass(frozen=True)
class ExtensionSettings:
    """Rounds of registration and triangulation over a recording (A 4.1)."""

    rounds: int = setting(
        5, limits=(1, 20), reason="most rounds, as in A section 4.1; extension stops where a round registers no more"
    )
    capacity: int = setting(
        40000, unit="landmarks", limits=(100, 1_000_000), reason="most landmarks that are added to the map"
    )


@dataclass(frozen=True)
class ExtensionRound:
    """One round.

    Attributes:
        shares: camera -> share of its images that are registered, in this round or before, 0 to 1.
        share: the same of all images.
        absolute: share of all images with enough landmarks of the photographs to be registered by these alone.
        places: camera -> (N, 3) positions of its registered images [m].
    """

    shares: Mapping[str, float]
    share: float
    absolute: float
    places: Mapping[str, NDArray[np.float64]]
