"""The mode that a camera films in: a read-out time belongs to it, and to no other."""

import math
from dataclasses import dataclass

_SAME_RATE, _SAME_FOCAL = 1.3, 1.01
"""Ratios of rates and focal lengths within one mode: 24, 25 and 30 images a second are read out alike, 60 are not."""


@dataclass(frozen=True)
class VideoMode:
    """Size, lens and rate of a camera's images.

    Attributes:
        width, height: [px].
        focal: focal length along the rows [px].
        rate: images a second [Hz]; NaN where it is unknown.
    """

    width: int
    height: int
    focal: float
    rate: float = math.nan

    def is_same(self, other: "VideoMode") -> bool:
        """Whether two modes are one as far as both are known."""
        same_size = (self.width, self.height) == (other.width, other.height)
        same_rate = math.isnan(self.rate + other.rate) or _ratio(self.rate, other.rate) < _SAME_RATE
        return same_size and same_rate and _ratio(self.focal, other.focal) < _SAME_FOCAL


def _ratio(one: float, other: float) -> float:
    return max(one, other) / min(one, other)
