"""Which loops a configuration does not close: what is apart, longer than it may be, or bent too far for it."""

import numpy as np

from bodycam_ros.mobility.angle_limits import AngleLimits
from bodycam_ros.mobility.mechanism import Configuration, Mechanism

CLOSED_SIGMAS = 3.0  # a loop that is strained less is closed
_SAID_M = 1e-3  # what is known is known to a millimetre
_BEYOND_RAD = np.radians(10.0) / CLOSED_SIGMAS  # sigma of a joint's limits: nobody is bent farther than 10 deg beyond


def open_loops(mechanism: Mechanism, configuration: Configuration) -> tuple[str, ...]:
    """Names of the loops that are not closed."""
    return tuple(name for name, strain in strains(mechanism, configuration).items() if strain > CLOSED_SIGMAS)


def strains(mechanism: Mechanism, configuration: Configuration) -> dict[str, float]:
    """Loop -> what it takes to close it, in sigmas.

    The root of three squares: of its worst row, of the unknown length in it that is farthest from what is said, and of
    the joint in it that is farthest beyond its limits. Together, because what is a little too far away is reached a
    little in each of these ways.
    """
    none = dict.fromkeys((joint.name for joint in mechanism.loops), 0.0)
    apart, longer, bent = none.copy(), none.copy(), none.copy()
    rows = mechanism.loop_rows(configuration)
    for owner, residual in zip(rows.owners, rows.residuals, strict=True):
        apart[owner] = max(apart[owner], abs(float(residual)))
    for name, sigma in mechanism.length_sigmas.items():
        far = np.abs(mechanism.longer_by(configuration, name)) / np.maximum(sigma, _SAID_M)
        for loop in mechanism.loops_through.get(name, (name,)):
            longer[loop] = max(longer[loop], float(far.max()))
    for row, excess, _ in AngleLimits(mechanism.body).excess(configuration.joint_motion):
        for loop in mechanism.loops_through[mechanism.body.tree_joints[row].name]:
            bent[loop] = max(bent[loop], float(np.abs(excess).max()) / _BEYOND_RAD)
    return {name: float(np.linalg.norm([apart[name], longer[name], bent[name]])) for name in none}
