"""A crank that nobody is seen to drive: on its own way it leads the limbs that are guessed, and is not led by them.

At once it goes on as it did. Over a whole recording it goes on from the speed that it had to the speed that it was
seen at again, by as many turns as fit best between them.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BPoly

from bodycam_ros.estimation.measurements import JointRotations
from bodycam_ros.geometry import Array

_COAST_RAD = 0.01
"""How far such a hinge may be from its way, each instant: the limbs that are guessed must not hold it up."""

_TOLD_S = 0.25
"""Before and after a stretch, that tell the motion at its ends: most of a stroke of a pedal, which is not even."""

_LASTS_S = 2.0
"""How long a change of speed that was seen goes on: a rider who starts has his speed by then."""


def coasting(rows: Sequence[int], rotations: Array) -> JointRotations:
    """Hinges, by their rows in ``tree_joints``, that are on their way at rotations (U, 3, 3)."""
    return JointRotations(np.array(rows, np.int64), rotations, np.full((len(rows), 3), _COAST_RAD))


def on_the_way(angles: Array, stamps_s: Array, driven: NDArray[np.bool_]) -> Array:
    """Angles (T) [rad] with stretches that nobody drove filled in: with speed and acceleration of both ends.

    Args:
        angles: (T) continuous where it is driven.
        stamps_s: (T) [s].
        driven: (T) whether an angle is known.
    """
    filled = angles.copy()
    known = np.flatnonzero(driven)
    if not len(known):
        return filled
    for first, last in zip(known[:-1].tolist(), known[1:].tolist(), strict=True):
        if last - first < 2:
            # What is continuous stays so, whatever was added before.
            filled[last:] += 2.0 * np.pi * np.round((filled[first] - filled[last]) / (2.0 * np.pi))
            continue
        T = stamps_s[last] - stamps_s[first]
        ends = _motion(filled, stamps_s, driven, first, -1), _motion(filled, stamps_s, driven, last, 1)
        # An instant that is known alone has no speed; the other end tells it.
        told = [end for end in ends if end is not None] or [(0.0, 0.0)]
        (v0, a0), (v1, a1) = told[0], told[-1]
        lasts = min(1.0, (_LASTS_S / T) ** 2)
        a0, a1 = lasts * a0, lasts * a1
        # The jerk is least on the way that ends here.
        expected = filled[first] + T * (v0 + v1) / 2.0 + T**2 * (a0 - a1) / 12.0
        filled[last:] += 2.0 * np.pi * np.round((expected - filled[last]) / (2.0 * np.pi))
        way = BPoly.from_derivatives(stamps_s[[first, last]], [[filled[first], v0, a0], [filled[last], v1, a1]])
        filled[first + 1 : last] = way(stamps_s[first + 1 : last])
    return filled


def _motion(
    angles: Array, stamps_s: Array, driven: NDArray[np.bool_], place: int, side: int
) -> tuple[float, float] | None:
    """Speed [rad/s] and acceleration [rad/s^2] at one end of a stretch, by what is beyond; None if nothing is."""
    end = place
    while (
        0 <= end + side < len(driven) and driven[end + side] and abs(stamps_s[end + side] - stamps_s[place]) < _TOLD_S
    ):
        end += side
    if end == place:
        return None
    beyond = np.arange(min(place, end), max(place, end) + 1)
    curve = np.polyfit(stamps_s[beyond] - stamps_s[place], np.unwrap(angles[beyond]), min(2, len(beyond) - 1))
    return float(curve[-2]), float(2.0 * curve[-3]) if len(curve) > 2 else 0.0
