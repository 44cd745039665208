"""The solver's joint states and odometry of an instant, put together."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.geometry import Array
from bodycam_ros.kinematics.joint_angles import JointAngles
from bodycam_ros.messages.factory import Message, numbers
from bodycam_ros.messages.header import stamp_ns
from bodycam_ros.messages.pose import pose_and_covariance

_KEPT = 100
"""Instants of which one half is waited for."""


class AnglesAndRoot:
    """Hears joint states and odometry.

    Args:
        on_instant: called with the stamp [ns], names and angles (J,) of joints [rad], and world_T_root (4, 4) [m].
        on_fault: called with what is wrong with a message.
    """

    def __init__(
        self,
        on_instant: Callable[[int, tuple[str, ...], NDArray[np.float64], Array], None],
        on_fault: Callable[[str], None],
    ) -> None:
        self._on_instant, self._on_fault = on_instant, on_fault
        self._angles: dict[int, tuple[tuple[str, ...], NDArray[np.float64]]] = {}
        self._roots: dict[int, Array] = {}

    def forget(self) -> None:
        """Wait for no half of what was told so far."""
        self._angles.clear()
        self._roots.clear()

    def hear_angles(self, message: Message) -> None:
        """sensor_msgs/JointState."""
        try:
            angles = numbers(message.position, np.float64, len(message.name))
        except ValueError as error:
            # Others publish on such topics, too: joint states without positions are theirs.
            self._on_fault(f"joint_states: malformed message ({error})")
            return
        stamp = stamp_ns(message.header.stamp)
        self._angles[stamp] = tuple(message.name), angles
        self._tell(stamp)

    def hear_root(self, message: Message) -> None:
        """nav_msgs/Odometry."""
        stamp = stamp_ns(message.header.stamp)
        self._roots[stamp] = pose_and_covariance(message.pose)[0]
        self._tell(stamp)

    def _tell(self, stamp: int) -> None:
        for waiting in (self._angles, self._roots):
            while len(waiting) > _KEPT:
                del waiting[next(iter(waiting))]
        if stamp in self._angles and stamp in self._roots:
            self._on_instant(stamp, *self._angles.pop(stamp), self._roots.pop(stamp))


class ToldBody(AnglesAndRoot):
    """Hears joint states and odometry of one body.

    Args:
        on_pose: called with the stamp [ns] and world_T_segment (S, 4, 4) [m] of every instant.
        on_fault: called with what is wrong with a message.
    """

    def __init__(self, on_pose: Callable[[int, Array], None], on_fault: Callable[[str], None]) -> None:
        super().__init__(self._place, on_fault)
        self._on_pose, self._on_fault = on_pose, on_fault
        self._body: BodyModel | None = None

    def is_of(self, body: BodyModel | None) -> None:
        """What is told from now on is of this body; None: of nobody known."""
        self._body = body
        self._joint_angles = None if body is None else JointAngles(body)
        self.forget()

    def _place(self, stamp: int, names: tuple[str, ...], angles: NDArray[np.float64], root: Array) -> None:
        if self._body is None or self._joint_angles is None:
            return
        told = dict(zip(names, angles.tolist(), strict=True))
        if missing := [name for name in self._joint_angles.names if name not in told]:
            self._on_fault(f"joint_states lacks {missing[0]}; is it of another robot_description?")
            return
        ours = np.array([told[name] for name in self._joint_angles.names])
        if not (np.isfinite(ours).all() and np.isfinite(root).all()):
            self._on_fault(f"joint_states or odometry at {stamp} ns is not finite")
            return
        self._on_pose(stamp, self._body.forward_kinematics(root, self._joint_angles.poses(ours)))
