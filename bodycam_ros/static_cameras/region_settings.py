"""How static cameras follow a body by its regions."""

from dataclasses import dataclass

import numpy as np

from bodycam_ros.geometry import Array
from bodycam_ros.settings import setting


@dataclass(frozen=True)
class RegionSettings:
    """Lines across the contour, colours on both sides of it, and how far what they say is trusted."""

    line_spacing: float = setting(
        6.0, unit="px", limits=(1.0, 50.0), reason="from line to line along the contour; neighbours tell the same"
    )
    rounds: int = setting(
        4,
        limits=(1, 20),
        reason="how often an image is asked, from where the body was found the time before; the first are coarse",
    )
    coarse_stride: int = setting(
        4,
        unit="px",
        limits=(1, 16),
        reason="pixels that are one sample in the first round, half as many in the next: a line then reaches 24 px",
    )
    least_sigma: float = setting(
        0.7, unit="px", limits=(0.1, 10.0), reason="of a line where its regions part within a pixel"
    )
    lines_alike: float = setting(
        6.0,
        limits=(1.0, 1000.0),
        reason="lines that err together, and so count as one: surface and colours are wrong for whole stretches",
    )
    inward: int = setting(12, unit="px", limits=(4, 100), reason="how far from the contour a segment's colours count")
    outward: int = setting(20, unit="px", limits=(4, 200), reason="the same of colours beside it")
    learning_rate: float = setting(
        0.15, limits=(0.0, 1.0), reason="share of an image in the colours that are known: sun and shadow change them"
    )
    least_lines: int = setting(
        4, limits=(1, 1000), reason="a segment with fewer lines that know something is not seen by a camera"
    )
    least_confidence: float = setting(
        0.3,
        limits=(0.0, 1.0),
        reason="share of a segment's lines that must know something; of one that is lost, no colours are learned",
    )
    start_rotation_sigma: float = setting(
        0.12, unit="rad", limits=(0.001, 3.2), reason="of segments that a person placed by hand"
    )
    start_translation_sigma: float = setting(0.04, unit="m", limits=(0.001, 1.0), reason="the same of their places")
    start_rounds: int = setting(
        6, limits=(1, 50), reason="how often colours are learned and the body is found anew in the first image"
    )

    @property
    def start_sigmas(self) -> Array:
        """(6,) how far a segment may be from where a person placed it [rad], [m]."""
        return np.repeat([self.start_rotation_sigma, self.start_translation_sigma], 3)

    @property
    def start_joint_sigma(self) -> float:
        """How far a joint may be from where a person placed its two segments [rad]."""
        return float(np.sqrt(2.0) * self.start_rotation_sigma)
