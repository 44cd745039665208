"""What couples a body to its equipment at one instant, as the solver has it: joints, and where something stands."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.kinematics.joint import Joint

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class HeldJoint:
    """A joint of the equipment, or an attachment that holds.

    Attributes:
        joint: of the equipment, or between it, as the parent, and the body.
        information: (6, 6) of its residual in the child's axes.
        kernel: sigmas from which on it gives way (Cauchy); None where it never does.
    """

    joint: Joint
    information: Array
    kernel: float | None = None


@dataclass(frozen=True, eq=False)
class Standing:
    """What stands still.

    Attributes:
        row: of its segment in the body.
        pose: (4, 4) world_T_segment.
        sigmas: (6) of it [rad], [m].
    """

    row: int
    pose: Array
    sigmas: Array


def held_joint(joint: Joint, unknown: Array, ends: tuple[Array, Array], kernel: float) -> HeldJoint:
    """An attachment that holds (B eq. 15): as soft as its place is unknown.

    Args:
        joint: of the attachment, where it has been learned to be.
        unknown: (3) sigmas of its place along the axes of the equipment's segment [m]; zero along what is known.
        ends: poses (4, 4) of its segments of the body and of the equipment.
        kernel: sigmas from which on it gives way (Cauchy).
    """
    if not unknown.any():
        return HeldJoint(joint, joint.information, kernel)
    # What is unknown lies along the equipment's axes, the joint's place in those of the body.
    body, equipment = (pose[:3, :3] for pose in ends)
    joint_R_equipment = (body @ joint.child_T_joint[:3, :3]).T @ equipment
    own = np.array(joint.sigmas)
    place = joint_R_equipment @ np.diag(unknown**2) @ joint_R_equipment.T + np.diag(own[3:] ** 2)
    A = joint.square_root_information.copy()
    A[3:] = np.linalg.cholesky(np.linalg.inv(place)).T @ (own[3:, None] * A[3:])
    return HeldJoint(joint, A.T @ A, kernel)
