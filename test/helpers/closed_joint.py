"""A joint that is closed, for tests of its gap and of its information."""

import numpy as np

from bodycam_ros.geometry import Array, adjoint, rigid
from bodycam_ros.kinematics.joint import Joint


def closed_pose(joint: Joint, parent_T_child: Array) -> Array:
    """The pose (4, 4) of the child in the parent that closes a joint and keeps its present rotation, if permitted."""
    joint_R = joint.parent_T_joint[:3, :3].T @ parent_T_child[:3, :3] @ joint.child_T_joint[:3, :3]
    rotation = joint.permitted_rotation(joint_R)
    pose: Array = joint.parent_T_joint @ rigid(rotation, np.zeros(3)) @ joint.joint_T_child
    return pose


def joint_information(joint: Joint) -> Array:
    """(6, 6) Ad' diag(1 / sigma^2) Ad with Ad = Ad(child_T_joint^-1) (DESIGN 4.2), of a tangent of the child segment.

    A hinge's sigmas are along its axis first.
    """
    along_axis = np.eye(6)
    along_axis[:3, :3] = joint.axes_of_rotation
    whitened = np.diag(1.0 / np.array(joint.sigmas)) @ along_axis @ adjoint(joint.joint_T_child)
    information: Array = whitened.T @ whitened
    return information
