"""The mass of a segment: how heavy it is, where its centre is, and how it resists turning."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bodycam_ros.geometry import Array


@dataclass(frozen=True, eq=False)
class Mass:
    """Of a segment, in its frame.

    Attributes:
        kilograms: its mass.
        centre: (3,) [m].
        inertia: (3, 3) about the centre [kg m^2].
    """

    kilograms: float
    centre: Array
    inertia: Array


def combined(parts: Sequence[Mass]) -> Mass:
    """The mass of rigidly joined parts in one frame, by the parallel axis theorem."""
    kilograms = sum(part.kilograms for part in parts)
    centre = sum((part.kilograms * part.centre for part in parts), np.zeros(3)) / kilograms
    inertia = np.zeros((3, 3))
    for part in parts:
        lever = part.centre - centre
        inertia += part.inertia + part.kilograms * (lever @ lever * np.eye(3) - np.outer(lever, lever))
    return Mass(kilograms, centre, inertia)
