"""Limits of joint angles as rows: none within them, a pull back beyond."""

from collections.abc import Iterator

import numpy as np

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.geometry import Array, exp_so3
from bodycam_ros.kinematics.euler_angles import EulerOrder
from bodycam_ros.kinematics.joint import Joint, hinge_angle

_SINGULAR = 1e-3


class AngleLimits:
    """The joints of a body's tree whose limits are known."""

    def __init__(self, body: BodyModel) -> None:
        self._joints = body.tree_joints
        limited = [row for row, joint in enumerate(self._joints) if joint.limits]
        self._balls = [row for row in limited if self._joints[row].type == "ball"]
        self._hinges = [row for row in limited if self._joints[row].type == "hinge"]
        self._order = EulerOrder(tuple(self._joints[row].angle_axes for row in self._balls))

    def middle(self, joint_motion: Array, share: float) -> Array:
        """The motion (J, 4, 4) with these joints a share of the way from zero to the middle of their limits."""
        motion = joint_motion.copy()
        for row in (*self._balls, *self._hinges):
            joint = self._joints[row]
            motion[row, :3, :3] = _rotation(joint, share * np.mean(joint.limits or (), axis=1))
        return motion

    def beyond(self, joint_motion: Array) -> dict[str, tuple[float, float]]:
        """Joint angle beyond its limits -> the angle, and by how much it is beyond [rad]."""
        found = {}
        for row, angles in self._angles(joint_motion):
            joint = self._joints[row]
            for name, angle, excess in zip(joint.angle_names, angles, _excess(joint, angles), strict=True):
                if excess:
                    found[name] = (float(angle), float(excess))
        return found

    def excess(self, joint_motion: Array) -> Iterator[tuple[int, Array, Array]]:
        """Joints that are beyond their limits: row, by how much (A) [rad], and how that changes with a turn (A, 3)."""
        for row, angles in self._angles(joint_motion):
            excess = _excess(self._joints[row], angles)
            if excess.any():
                yield row, excess, np.where(excess[:, None] != 0.0, _rates(self._joints[row], angles), 0.0)

    def _angles(self, joint_motion: Array) -> Iterator[tuple[int, Array]]:
        """Row and angles (A) [rad] of each joint."""
        if self._balls:
            angles = self._order.decompose(joint_motion[self._balls, :3, :3], np.zeros((len(self._balls), 3)))
            yield from zip(self._balls, angles, strict=True)
        for row in self._hinges:
            yield row, np.atleast_1d(hinge_angle(joint_motion[row, :3, :3], self._joints[row].axis))


def _excess(joint: Joint, angles: Array) -> Array:
    low, high = np.array(joint.limits).T
    excess: Array = np.maximum(angles - high, 0.0) + np.minimum(angles - low, 0.0)
    return excess


def _rotation(joint: Joint, angles: Array) -> Array:
    if joint.type == "hinge":
        return joint.hinge_rotation(angles[0])
    rotation: Array = EulerOrder((joint.angle_axes,)).compose(angles[None])[0]
    return rotation


def _rates(joint: Joint, angles: Array) -> Array:
    """(A, 3) how the angles change with a turn of the joint's rotation about its own axes."""
    if joint.type == "hinge":
        return joint.axis[None]
    first, middle, last = np.eye(3)[["xyz".index(axis) for axis in joint.angle_axes]]
    R_last = exp_so3(angles[2] * last)
    R_middle = exp_so3(angles[1] * middle) @ R_last
    turns = np.stack([R_middle.T @ first, R_last.T @ middle, last], axis=1)
    return np.asarray(np.linalg.pinv(turns, rcond=_SINGULAR), dtype=np.float64)
