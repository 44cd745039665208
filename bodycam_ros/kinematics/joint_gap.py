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


def row_axes(joint: Joint) -> Array:
    """(3, 3) axes of its three rotation rows, as rows, in the joint's frame."""
    scaled = joint.square_root_information[:3, :3] @ joint.child_T_joint[:3, :3]
    axes: Array = scaled / np.linalg.norm(scaled, axis=1, keepdims=True)
    return axes


def joint_gap(joint: Joint, world_T_parent: Array, world_T_child: Array) -> Array:
    """The gap (..., 6), [rad] and [m], of the poses (..., 4, 4) of its segments."""
    gap, _ = _gap(joint, world_T_parent, world_T_child)
    return np.concatenate([_forbidden(joint, gap)[0] @ row_axes(joint).T, -inverse(gap)[..., :3, 3]], axis=-1)


def gap_jacobians(joint: Joint, world_T_parent: Array, world_T_child: Array) -> tuple[Array, Array]:
    """How ``joint_gap`` changes with the tangents of parent and child in their own axes: (..., 6, 6) each."""
    gap, joint_T_parent = _gap(joint, world_T_parent, world_T_child)
    by_gap = np.zeros((*gap.shape[:-2], 6, 6))
    by_gap[..., :3, :3] = row_axes(joint) @ _forbidden(joint, gap)[1]
    by_gap[..., 3:, :3], by_gap[..., 3:, 3:] = hat(-inverse(gap)[..., :3, 3]), np.eye(3)
    by_parent: Array = -by_gap @ adjoint(inverse(gap) @ joint_T_parent)
    by_child: Array = by_gap @ adjoint(joint.joint_T_child)
    return by_parent, by_child


def turn_jacobian(rotation_vector: Array) -> Array:
    """(..., 3, 3) by which log_so3(R exp(w)) grows with w at w = 0; the inverse right Jacobian of SO(3)."""
    half = np.maximum(np.linalg.norm(rotation_vector, axis=-1), 1e-4)[..., None, None] / 2.0
    W = hat(rotation_vector)
    series: Array = np.eye(3) + 0.5 * W + (1.0 - half / np.tan(half)) / (4.0 * half**2) * (W @ W)
    return series


def _gap(joint: Joint, world_T_parent: Array, world_T_child: Array) -> tuple[Array, Array]:
    """parent_joint_T_child_joint, and joint_T_parent."""
    joint_T_parent = inverse(joint.parent_T_joint)
    return joint_T_parent @ inverse(world_T_parent) @ world_T_child @ joint.child_T_joint, joint_T_parent


def _forbidden(joint: Joint, gap: Array) -> tuple[Array, Array]:
    """Rotation vector (..., 3) of what the type forbids, and how it changes with a turn (..., 3, 3) of the child."""
    R = gap[..., :3, :3]
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
