"""A crank that nobody is seen to drive: on its own way it leads the limbs that are guessed, and is not led by them.

Over a whole recording it goes on from the speed that it had to the speed that it was seen at again, by as many turns as
fit best between them.
"""

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.geometry import Array

_SPEED_INSTANTS = 4
"""Before and after a stretch that tell the speed at its ends."""


def on_the_way(angles: Array, stamps_s: Array, driven: NDArray[np.bool_]) -> Array:
    """Angles (T) [rad] with stretches that nobody drove filled in: a cubic with the speeds at both of its ends.

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
        whole_s = stamps_s[last] - stamps_s[first]
        speeds = _speed(filled, stamps_s, driven, first, -1), _speed(filled, stamps_s, driven, last, 1)
        # An instant that is known alone has no speed; the other end tells it.
        told = [speed for speed in speeds if speed is not None] or [0.0]
        leaving, arriving = told[0], told[-1]
        expected = filled[first] + 0.5 * whole_s * (leaving + arriving)
        filled[last:] += 2.0 * np.pi * np.round((expected - filled[last]) / (2.0 * np.pi))
        u = (stamps_s[first + 1 : last] - stamps_s[first]) / whole_s
        way = filled[last] - filled[first]
        filled[first + 1 : last] = (
            filled[first]
            + (3.0 * u**2 - 2.0 * u**3) * way
            + whole_s * ((u**3 - 2.0 * u**2 + u) * leaving + (u**3 - u**2) * arriving)
        )
    return filled


def _speed(angles: Array, stamps_s: Array, driven: NDArray[np.bool_], place: int, side: int) -> float | None:
    """The speed [rad/s] at one end of a stretch, by the instants beyond it; None if there are none."""
    end = place
    while 0 <= end + side < len(driven) and driven[end + side] and abs(end + side - place) <= _SPEED_INSTANTS:
        end += side
    if end == place:
        return None
    beyond = np.arange(min(place, end), max(place, end) + 1)
    steps = np.diff(np.unwrap(angles[beyond])) / np.diff(stamps_s[beyond])
    return float(steps.mean())
