"""The range of motion: limits of joint angles, what is beyond them, and rotations put back into them."""

from copy import copy

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.geometry import Array
from bodycam_ros.kinematics.joint_angles import JointAngles
from bodycam_ros.kinematics.tree import KinematicTree


class JointLimits:
    """The limits of a tree's joints.

    Attributes:
        angles: of the tree.
        low, high: (A) of each angle [rad]; infinite where no limit is known.
    """

    def __init__(self, tree: KinematicTree) -> None:
        self.angles = JointAngles(tree)
        none = ((-np.inf, np.inf),)
        pairs = [pair for joint in tree.tree_joints for pair in joint.limits or none * len(joint.angle_names)]
        self.low, self.high = np.array(pairs, dtype=np.float64).reshape(-1, 2).T.copy()
        self._at_rest = np.clip(np.zeros(len(pairs)), self.low, self.high)

    def excess(self, angles: Array) -> Array:
        """By how much (..., A) angles (..., A) [rad] are above their limits; negative below, zero within."""
        excess: Array = np.maximum(angles - self.high, 0.0) + np.minimum(angles - self.low, 0.0)
        return excess

    def middle(self, share: float = 1.0) -> Array:
        """Joint rotations (J, 3, 3) a share of the way from zero to the middle of their limits; zero without limits."""
        bounded = np.isfinite(self.low) & np.isfinite(self.high)
        low, high = np.where(bounded, self.low, 0.0), np.where(bounded, self.high, 0.0)
        return self.angles.rotations(share * (0.5 * low + 0.5 * high))

    def clamp(self, rotations: Array) -> Array:
        """Joint rotations (J, 3, 3) with every angle put back into its limits; themselves if none is beyond."""
        angles = self.nearest_angles(rotations)
        if not self.excess(angles).any():
            return rotations
        return self.angles.rotations(np.clip(angles, self.low, self.high))

    def widened(self, rotations: Array, seen: NDArray[np.bool_]) -> "JointLimits":
        """Limits that hold the angles of some joints (J,) of rotations (J, 3, 3) as well."""
        angles, widened = self.nearest_angles(rotations), copy(self)
        chosen = seen[self.angles.joint_rows]
        widened.low = np.where(chosen, np.minimum(self.low, angles), self.low)
        widened.high = np.where(chosen, np.maximum(self.high, angles), self.high)
        return widened

    def nearest_angles(self, rotations: Array) -> Array:
        """Angles (A) [rad] of joint motions (J, 3, 3) or (J, 4, 4), of all triples and turns those nearest to zero."""
        return self.angles.angles(rotations, self._at_rest)
