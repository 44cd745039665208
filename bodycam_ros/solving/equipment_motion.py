"""How the equipment moves by itself: what has inertia keeps its speed, hinges turn about their axes alone."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.equipment.equipment import Equipment
from bodycam_ros.geometry import inverse, rigid
from bodycam_ros.kinematics.joint import Joint, hinge_angle
from bodycam_ros.solving.equipment_chain import closed_but_sliding
from bodycam_ros.solving.motion import MotionSettings

Array = NDArray[np.float64]

_COASTING = 0.1
"""Nobody seen, what keeps its speed is led by it alone: limbs that are guessed must not drive it."""


class EquipmentMotion:
    """Predicts the equipment's segments.

    Args:
        equipment: how its segments move.
        tree: its own joints, parents first.
        motion: how suddenly segments change their motion, where the equipment does not say.
        speed_time: over which the speed of what keeps it is averaged [s].

    Attributes:
        keeping_joints: names of the hinges whose child keeps its speed.
        keeping: (E) which segments keep their speed.
    """

    def __init__(self, equipment: Equipment, tree: Sequence[Joint], motion: MotionSettings, speed_time: float) -> None:
        self._moves = list(equipment.segments.values())
        self._motion, self._speed_time = motion, speed_time
        self._row = {name: row for row, name in enumerate(equipment.segments)}
        self._tree = tuple(tree)
        self.keeping_joints = {
            joint.name for joint in tree if joint.type == "hinge" and equipment.segments[joint.child].keeps_speed
        }
        self.keeping = np.array([moves.keeps_speed for moves in self._moves], bool)
        self._speeds: dict[str, float] = {}
        below = [{a.name for a in equipment.attachments if a.equipment_segment == name} for name in self._row]
        for joint in reversed(self._tree):
            below[self._row[joint.parent]] |= below[self._row[joint.child]]
        self._held_below = [frozenset(names) for names in below]

    def held_below(self, segment: str) -> frozenset[str]:
        """The attachments to a segment, and to those that hang on it."""
        return self._held_below[self._row[segment]]

    def forget(self) -> None:
        """No speed is known any more."""
        self._speeds.clear()

    def sigmas(self, dt_s: float, previous_dt_s: float, is_driven: Callable[[frozenset[str]], bool]) -> Array:
        """(E, 6) by how much segments may deviate from their prediction over a time [rad], [m].

        Args:
            dt_s: the time [s].
            previous_dt_s: that of the step before it [s].
            is_driven: whether any of some attachments is seen to hold.
        """
        return self.accelerations(is_driven) * 0.5 * dt_s * (dt_s + previous_dt_s)

    def accelerations(self, is_driven: Callable[[frozenset[str]], bool]) -> Array:
        """(E, 6) how suddenly segments change their motion [rad/s^2], [m/s^2]; see ``sigmas``."""
        usual = [self._motion.angular_acceleration_sigma, self._motion.acceleration_sigma]
        accelerations = np.tile(np.repeat(usual, 3), (len(self._moves), 1))
        for row, moves in enumerate(self._moves):
            if moves.angular_acceleration_sigma is not None:
                accelerations[row, :3] = moves.angular_acceleration_sigma
            if moves.acceleration_sigma is not None:
                accelerations[row, 3:] = moves.acceleration_sigma
            if moves.keeps_speed and not is_driven(self._held_below[row]):
                accelerations[row, :3] *= _COASTING
        return accelerations

    def predict(self, poses: Array, before: Array, joints: Sequence[Joint], dt_s: float) -> Array:
        """Poses (E, 4, 4) with joints closed, and hinges that keep their speed turned by it.

        Args:
            poses: (E, 4, 4) where segments would go by themselves.
            before: (E, 4, 4) where they were.
            joints: its own, parents first.
            dt_s: the time in between [s].
        """
        poses = poses.copy()
        for joint in joints:
            p, c = self._row[joint.parent], self._row[joint.child]
            if joint.name in self._speeds:
                angle = _angle(joint, before[p], before[c]) + dt_s * self._speeds[joint.name]
                turn = rigid(joint.hinge_rotation(np.array(angle)), np.zeros(3))
                poses[c] = poses[p] @ joint.parent_T_joint @ turn @ joint.joint_T_child
            else:
                poses[c] = poses[p] @ closed_but_sliding(joint, inverse(poses[p]) @ poses[c])
        return poses

    def learn_speeds(
        self, latest: Array, before: Array, dt_s: float, is_driven: Callable[[frozenset[str]], bool]
    ) -> None:
        """Hear where the segments (E, 4, 4) were at two instants; what nobody sees driven keeps the speed it has."""
        share = 1.0 - np.exp(-dt_s / self._speed_time)
        for joint in self._tree:
            p, c = self._row[joint.parent], self._row[joint.child]
            if joint.name in self.keeping_joints and is_driven(self._held_below[c]):
                step = _angle(joint, latest[p], latest[c]) - _angle(joint, before[p], before[c])
                speed = float((step + np.pi) % (2.0 * np.pi) - np.pi) / dt_s
                known = self._speeds.get(joint.name, speed)
                self._speeds[joint.name] = known + share * (speed - known)


def _angle(joint: Joint, parent: Array, child: Array) -> float:
    return float(hinge_angle(joint.joint_rotation(parent[:3, :3].T @ child[:3, :3]), joint.axis))
