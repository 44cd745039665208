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
        reason="share of an image in the colours that are known: sun and shadow change them; raise it where light "
        "changes fast, at the risk of learning the background",
    )
    least_confidence: float = setting(
        0.3,
        limits=(0.0, 1.0),
        reason="share of a segment's lines that must measure something; raise it to reject more. Of a segment below it "
        "no colours are learned",
    )
