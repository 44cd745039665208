"""The axes of other programs. Ours are REP-103's: x forward, y left, z up."""

from collections.abc import Mapping

import numpy as np

from bodycam_ros.geometry import Array

UP_AXES: Mapping[str, Array] = {
    "y": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]),
    "z": np.eye(3),
}
"""Axis that is up in a program -> program_R_world (3, 3). Blender, three.js and Unreal turn y up back so."""

FACING_FORWARD = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
"""Turns a body that faces along x to where programs for animation want it in its rest pose: along -y where z is up, so
along +z where y is."""

OPENSIM_R_OURS = UP_AXES["y"]
"""Of the ground and of every segment: OpenSim has x forward, y up and z to the right."""


def turned(program_R_world: Array, rotations: Array) -> Array:
    """Rotations (..., 3, 3) as they are about a program's axes."""
    about: Array = program_R_world @ rotations @ program_R_world.T
    return about
