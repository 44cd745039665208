"""What the solver tells of an instant in two messages, put together."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.geometry import Array
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
