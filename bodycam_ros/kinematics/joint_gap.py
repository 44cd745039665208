"""How far a joint is from closed, as rows, and how the rows change as its two segments move.

The gap is that of the joint's frames on the two segments, ``parent_joint_T_child_joint``: the rotation that the type
forbids, about the rows' axes, then the place of the one frame in the other.
"""

import numpy as np

from bodycam_ros.geometry import Array, adjoint, hat, inverse, log_so3
from bodycam_ros.kinematics.joint import Joint, hinge_angle

GIVES_RAD, GIVES_M = 1.0, 0.25
"""A sigma of this size or more holds nothing: a seat that slides has one, a strap or a soft sole does not."""


def held_rows(joint: Joint) -> tuple[int, ...]:
    """Which of its six rows, rotation first and a hinge's own axis before those across it, the joint holds."""
    assert joint.sigmas is not None  # set when it was made
    gives, free = np.repeat([GIVES_RAD, GIVES_M], 3), joint.free_rows(GIVES_M)
    return tuple(row for row in range(6) if row not in free and joint.sigmas[row] < gives[row])


def joint_gap(joint: Joint, world_T_parent: Array, world_T_child: Array) -> Array:
    """The gap (..., 6), [rad] and [m], of the poses (..., 4, 4) of its segments; rows as in ``Joint.sigmas``."""
    return gap_jacobians(joint, world_T_parent, world_T_child)[0]


def gap_jacobians(joint: Joint, world_T_parent: Array, world_T_child: Array) -> tuple[Array, Array, Array]:
    """``joint_gap``, and how it changes with the tangents of parent and child in their own axes: (..., 6, 6) each."""
    joint_T_parent = inverse(joint.parent_T_joint)
    gap = joint_T_parent @ inverse(world_T_parent) @ world_T_child @ joint.child_T_joint
    gap_inverse, (forbidden, by_turn) = inverse(gap), _forbidden(joint, gap[..., :3, :3])
    by_gap = np.zeros((*gap.shape[:-2], 6, 6))
    by_gap[..., :3, :3] = joint.axes_of_rotation @ by_turn
    by_gap[..., 3:, :3], by_gap[..., 3:, 3:] = hat(-gap_inverse[..., :3, 3]), np.eye(3)
    residual = np.concatenate([forbidden @ joint.axes_of_rotation.T, -gap_inverse[..., :3, 3]], axis=-1)
    return residual, -by_gap @ adjoint(gap_inverse @ joint_T_parent), by_gap @ adjoint(joint.joint_T_child)


def turn_jacobian(rotation_vector: Array) -> Array:
    """(..., 3, 3) by which log_so3(R exp(w)) grows with w at w = 0; the inverse right Jacobian of SO(3)."""
    half = np.maximum(np.linalg.norm(rotation_vector, axis=-1), 1e-4)[..., None, None] / 2.0
    W = hat(rotation_vector)
    series: Array = np.eye(3) + 0.5 * W + (1.0 - half / np.tan(half)) / (4.0 * half**2) * (W @ W)
    return series


def _forbidden(joint: Joint, R: Array) -> tuple[Array, Array]:
    """Rotation vector (..., 3) of what the type forbids, and how it changes with a turn (..., 3, 3) of the child."""
    if joint.type in ("ball", "free"):
        return np.zeros(R.shape[:-1]), np.zeros(R.shape)
    swing = R if joint.type == "weld" else joint.hinge_rotation(-hinge_angle(R, joint.axis)) @ R
    forbidden = log_so3(swing)
    J = turn_jacobian(forbidden)
    if joint.type == "weld":
        return forbidden, J
    # The hinge's own angle follows, so that nothing of the swing is about the axis.
    of_axis = J @ np.swapaxes(swing, -1, -2) @ joint.axis
    along = (joint.axis @ J) / (of_axis @ joint.axis)[..., None]
    return forbidden, J - of_axis[..., :, None] * along[..., None, :]
