"""How the equipment moves by itself: what has inertia keeps its speed."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.equipment.equipment import Equipment
from bodycam_ros.estimation.motion_model import MotionSettings
from bodycam_ros.kinematics.joint import Joint

Array = NDArray[np.float64]


class EquipmentMotion:
    """Predicts the equipment's segments.

    Args:
        equipment: how its segments move.
        tree: its own joints, parents first.
        motion: how suddenly segments change their motion, where the equipment does not say.

    Attributes:
        keeping_joints: names of the hinges whose child keeps its speed.
    """

    def __init__(self, equipment: Equipment, tree: Sequence[Joint], motion: MotionSettings) -> None:
        self._moves = list(equipment.segments.values())
        self._motion = motion
        self._row = {name: row for row, name in enumerate(equipment.segments)}
        self._tree = tuple(tree)
        self.keeping_joints = {
            joint.name for joint in tree if joint.type == "hinge" and equipment.segments[joint.child].keeps_speed
        }
        below = [{a.name for a in equipment.attachments if a.equipment_segment == name} for name in self._row]
        for joint in reversed(self._tree):
            below[self._row[joint.parent]] |= below[self._row[joint.child]]
        self._held_below = [frozenset(names) for names in below]

    def held_below(self, segment: str) -> frozenset[str]:
        """The attachments to a segment, and to those that hang on it."""
        return self._held_below[self._row[segment]]

    @property
    def accelerations(self) -> Array:
        """(E, 6) how suddenly segments change their motion [rad/s^2], [m/s^2]."""
        usual = [self._motion.angular_acceleration_sigma, self._motion.acceleration_sigma]
        accelerations = np.tile(np.repeat(usual, 3), (len(self._moves), 1))
        for row, moves in enumerate(self._moves):
            if moves.angular_acceleration_sigma is not None:
                accelerations[row, :3] = moves.angular_acceleration_sigma
            if moves.acceleration_sigma is not None:
                accelerations[row, 3:] = moves.acceleration_sigma
        return accelerations
