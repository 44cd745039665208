"""A rotation as turns about the axes of one-axis joints in a row, near those of the instant before."""

import numpy as np

from bodycam_ros.geometry import Array, exp_so3
from bodycam_ros.kinematics.euler_angles import nearest_turn
from bodycam_ros.kinematics.joint import hinge_angle

_FROZEN = 0.02
"""Nearer than this to the singularity [rad], the first angle stays. An arm that hangs is there all the time, and noise
would spin it. What is lost of the rotation is at most as much, and is told."""

_BOTH = (0.0, np.pi)


def composed(axes: Array, angles: Array) -> Array:
    """(3, 3) the rotation of turns (N) [rad] about axes (N, 3), one after the other, about axes that move along."""
    rotation = np.eye(3)
    for axis, angle in zip(axes, angles, strict=True):
        rotation = rotation @ exp_so3(angle * axis)
    return rotation


def nearest_angles(rotation: Array, axes: Array, previous: Array) -> Array:
    """(N) angles [rad] about one axis or three (N, 3), whose turns are as near to a rotation (3, 3) as these axes can.

    Of three axes neighbours are perpendicular, so that every rotation is reached, by two triples: the one nearer to the
    previous angles (N) is taken, and no angle jumps by a turn.
    """
    if len(axes) == 1:
        return nearest_turn(hinge_angle(rotation[None], axes), previous)
    first_axis, middle_axis, last_axis = axes
    across = np.cross(middle_axis, last_axis)
    # What the middle turn leaves of the last axis is seen from the first one: where it points tells the first angle.
    seen = last_axis if abs(first_axis @ last_axis) < 0.5 else across
    pointing = rotation @ last_axis
    x, y = pointing @ seen, pointing @ np.cross(first_axis, seen)
    principal = previous[0] if np.hypot(x, y) < _FROZEN else np.arctan2(y, x)
    candidates = []
    for first in principal + np.array(_BOTH):
        rest = exp_so3(-first * first_axis) @ rotation
        turned = rest @ last_axis
        middle = np.arctan2(turned @ across, turned @ last_axis)
        back = rest.T @ middle_axis
        last = np.arctan2(back @ across, back @ middle_axis)
        candidates.append(nearest_turn(np.array([first, middle, last]), previous))
    return min(candidates, key=lambda angles: float(np.sum((angles - previous) ** 2)))
