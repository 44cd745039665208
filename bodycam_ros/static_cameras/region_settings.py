"""How static cameras follow a body by its regions."""

from dataclasses import dataclass

from bodycam_ros.settings import setting

LINES_ALIKE = 6.0
"""Lines that err together and count as one: surface and colours are wrong for whole stretches."""

MIN_LINES = 4
"""Lines of a segment that measure something; with fewer it is unobserved by a camera."""

LEAST_SIGMA_PX = 0.7
"""Sigma of a line whose regions part within a pixel."""


@dataclass(frozen=True)
class RegionSettings:
    """How fast colours are learned, and how much of a segment's contour must be measured."""

    learning_rate: float = setting(
        0.15,
        limits=(0.0, 1.0),
        reason="weight of a new image in the learned colours; raise it where the light changes fast (sun and shadow), "
        "at the risk of learning the background",
    )
    least_confidence: float = setting(
        0.3,
        limits=(0.0, 1.0),
        reason="minimum share of a segment's contour lines that must give a measurement; raise it to reject more "
        "segments. Below it no colours are learned of a segment",
    )
