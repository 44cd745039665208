"""Where a foot touches the floor: two points of its sole, which no body file knows, from the length of the shin."""

import numpy as np

from bodycam_ros.geometry import Array

_DEPTH, _HEEL, _BALL = 0.19, -0.12, 0.29
"""Below, behind and ahead of the ankle, in lengths of a shin: 8, 5 and 12.5 cm of a person of 1.75 m in flat shoes."""


def sole_points(shin_length: float) -> Array:
    """Heel and ball (2, 3) [m] in the frame of a foot: origin at the ankle, x forward and z up in the N-pose."""
    return shin_length * np.array([[_HEEL, 0.0, -_DEPTH], [_BALL, 0.0, -_DEPTH]])
