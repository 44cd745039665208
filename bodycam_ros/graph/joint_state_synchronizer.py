"""Pairs of joint states and odometry with one stamp: the pose of a body."""

from collections.abc import Callable

import numpy as np

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.geometry import Array
from bodycam_ros.kinematics.joint_angles import JointAngles
from bodycam_ros.messages.factory import Message, numbers, stamp_ns
from bodycam_ros.messages.poses import pose_and_covariance

_UNPAIRED = 100
"""Messages of one kind that may wait for the other."""


class JointStateSynchronizer:
    """Combines a body's joint states and odometry by their stamps.

    Args:
        on_pose: called with stamp [ns], angles (A,) in the order of ``JointAngles`` [rad], and world_T_root (4, 4) [m].
        on_fault: called with the fault of a message.
    """

    def __init__(self, on_pose: Callable[[int, Array, Array], None], on_fault: Callable[[str], None]) -> None:
        self._on_pose, self._on_fault = on_pose, on_fault
        self._names: tuple[str, ...] | None = None
        self.clear()

    def set_body(self, body: BodyModel | None) -> None:
        """Use this body for all later messages; None: drop them."""
        self._names = None if body is None else JointAngles(body).names
        self.clear()

    def clear(self) -> None:
        """Drop messages without a partner."""
        self._angles: dict[int, dict[str, float]] = {}
        self._roots: dict[int, Array] = {}

    def add_joint_state(self, message: Message) -> None:
        """Add a sensor_msgs/JointState."""
        try:
            angles = numbers(message.position, np.float64, len(message.name)).tolist()
        except ValueError as error:
            # Other nodes publish on such topics too, without positions.
            self._on_fault(f"joint_states: malformed message ({error})")
            return
        stamp = stamp_ns(message.header.stamp)
        self._angles[stamp] = dict(zip(message.name, angles, strict=True))
        self._combine(stamp)

    def add_odometry(self, message: Message) -> None:
        """Add a nav_msgs/Odometry."""
        stamp = stamp_ns(message.header.stamp)
        self._roots[stamp] = pose_and_covariance(message.pose)[0]
        self._combine(stamp)

    def _combine(self, stamp: int) -> None:
        for waiting in (self._angles, self._roots):
            while len(waiting) > _UNPAIRED:
                del waiting[next(iter(waiting))]
        if stamp not in self._angles or stamp not in self._roots:
            return
        by_name, world_T_root = self._angles.pop(stamp), self._roots.pop(stamp)
        if self._names is None:
            return
        if missing := [name for name in self._names if name not in by_name]:
            self._on_fault(f"joint_states lacks {missing[0]}; is it of another robot_description?")
            return
        angles = np.array([by_name[name] for name in self._names])
        if not (np.isfinite(angles).all() and np.isfinite(world_T_root).all()):
            self._on_fault(f"joint_states or odometry at {stamp} ns is not finite")
            return
        self._on_pose(stamp, angles, world_T_root)
