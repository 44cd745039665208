"""The straight limbs of the N-pose as a prior of the refinement (A eq. 17): only they hold a hinge along its axis."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_edit import joint_named
from bodycam_ros.calibration.articulation import ArticulatedMotion
from bodycam_ros.calibration.first_body import straight_line
from bodycam_ros.calibration.hinge import shift_to_line

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class StraightLimb:
    """What the N-pose says of a hinge: ``row @ offsets.ravel() == 0`` puts its joint on the straight limb.

    Attributes:
        row: (3 S) derivative of the joint's distance from the line, along the hinge's axis, by all offsets.
        value: that distance at the first body [m].
    """

    row: Array
    value: float


def straight_limbs(motion: ArticulatedMotion, hinges: Mapping[str, Array]) -> list[StraightLimb]:
    """What the N-pose says of each hinge's place along its axis (A eq. 17), linearised."""
    limbs = []
    for name in [joint.name for joint in motion.body.tree_joints if joint.child in hinges]:

        def off_line(offsets: Array, name: str = name) -> float:
            body = replace(motion, offsets=offsets).body_with_geometry()
            joint = joint_named(body, name)
            return -shift_to_line(joint.parent_T_joint[:3, 3], hinges[joint.child], *straight_line(body, joint))

        limbs.append(_linearised(motion, off_line))
    return limbs


def _linearised(motion: ArticulatedMotion, residual: Callable[[Array], float]) -> StraightLimb:
    """A straight limb's residual, linearised numerically at the first body.

    Args:
        residual: offsets (S, 3) -> distance of the hinge's joint from the straight limb's line, along its axis [m].
    """
    step = 1e-6
    flat = motion.offsets.ravel()
    unit = np.eye(len(flat))
    shape = motion.offsets.shape
    row = np.array(
        [
            (residual((flat + step * e).reshape(shape)) - residual((flat - step * e).reshape(shape))) / (2 * step)
            for e in unit
        ]
    )
    return StraightLimb(row, residual(motion.offsets))
