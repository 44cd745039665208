"""Pairs of joint states and odometry with one stamp, and the segment poses that they give."""

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
        on_state: called with stamp [ns], names and angles (J,) of joints [rad], and world_T_root (4, 4) [m].
        on_fault: called with the fault of a message.
    """

    def __init__(
        self,
        on_state: Callable[[int, tuple[str, ...], Array, Array], None],
        on_fault: Callable[[str], None],
    ) -> None:
        self._on_state, self._on_fault = on_state, on_fault
        self._angles: dict[int, tuple[tuple[str, ...], Array]] = {}
        self._roots: dict[int, Array] = {}

    def clear(self) -> None:
        """Drop messages without a partner."""
        self._angles.clear()
        self._roots.clear()

    def add_joint_state(self, message: Message) -> None:
        """Add a sensor_msgs/JointState."""
        try:
            angles = numbers(message.position, np.float64, len(message.name))
        except ValueError as error:
            # Other nodes publish on such topics too, without positions.
            self._on_fault(f"joint_states: malformed message ({error})")
            return
        stamp = stamp_ns(message.header.stamp)
        self._angles[stamp] = tuple(message.name), angles
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
        if stamp in self._angles and stamp in self._roots:
            self._on_state(stamp, *self._angles.pop(stamp), self._roots.pop(stamp))


class PoseSynchronizer(JointStateSynchronizer):
    """Segment poses of one body from its joint states and odometry.

    Args:
        on_pose: called with stamp [ns] and world_T_segment (S, 4, 4) [m].
        on_fault: called with the fault of a message.
    """

    def __init__(self, on_pose: Callable[[int, Array], None], on_fault: Callable[[str], None]) -> None:
        super().__init__(self._compute_poses, on_fault)
        self._on_pose = on_pose
        self._body: BodyModel | None = None

    def set_body(self, body: BodyModel | None) -> None:
        """Use this body for all later messages; None: drop them."""
        self._body = body
        self._joint_angles = None if body is None else JointAngles(body)
        self.clear()

    def _compute_poses(self, stamp: int, names: tuple[str, ...], angles: Array, world_T_root: Array) -> None:
        if self._body is None or self._joint_angles is None:
            return
        by_name = dict(zip(names, angles.tolist(), strict=True))
        if missing := [name for name in self._joint_angles.names if name not in by_name]:
            self._on_fault(f"joint_states lacks {missing[0]}; is it of another robot_description?")
            return
        ordered = np.array([by_name[name] for name in self._joint_angles.names])
        if not (np.isfinite(ordered).all() and np.isfinite(world_T_root).all()):
            self._on_fault(f"joint_states or odometry at {stamp} ns is not finite")
            return
        self._on_pose(stamp, self._body.forward_kinematics(world_T_root, self._joint_angles.poses(ordered)))
