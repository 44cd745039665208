"""Joint angles: the rotations of a body's joints as one vector of continuous angles, and back.

A ball joint is three angles whose middle axis is the child's long axis (DESIGN 3), named ``<joint>_<axis>`` in the
order of ``Joint.angle_axes``; a hinge is one angle, named as the joint; a weld is none. A free joint is a place,
``<joint>_at_x``, ``_at_y``, ``_at_z`` [m], and then the angles of a ball; both are meant where this says "angles".
"""

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.geometry import Array
from bodycam_ros.kinematics.euler_angles import EulerOrder, nearest_turn
from bodycam_ros.kinematics.joint import FULL_TURN, hinge_angle
from bodycam_ros.kinematics.tree import KinematicTree


class JointAngles:
    """Where each joint's angles [rad], and a free joint's place [m], stand in the vector of all (A) of a body.

    Attributes:
        names: (A) of the angles.
        joint_rows: (A) of the joint that each angle is of, in ``KinematicTree.tree_joints``.
    """

    def __init__(self, tree: KinematicTree) -> None:
        self.tree = tree
        self.names: tuple[str, ...] = tuple(name for joint in tree.tree_joints for name in joint.angle_names)
        self._balls = [row for row, joint in enumerate(tree.tree_joints) if joint.type in ("ball", "free")]
        self._hinges = [row for row, joint in enumerate(tree.tree_joints) if joint.type == "hinge"]
        column_of = {name: column for column, name in enumerate(self.names)}
        columns = [[column_of[name] for name in joint.angle_names] for joint in tree.tree_joints]
        # Of a free joint's six the last three are a ball's.
        self._ball_columns = np.array([columns[row][-3:] for row in self._balls], dtype=int).reshape(-1, 3)
        self._free = [row for row, joint in enumerate(tree.tree_joints) if joint.type == "free"]
        self._place_columns = np.array([columns[row][:3] for row in self._free], dtype=int).reshape(-1, 3)
        self._hinge_columns = np.array([columns[row][0] for row in self._hinges], dtype=int)
        self._hinge_axes = np.array([tree.tree_joints[row].axis for row in self._hinges]).reshape(-1, 3)
        self._order = EulerOrder(tuple(tree.tree_joints[row].angle_axes for row in self._balls))
        self.joint_rows = np.repeat(np.arange(len(columns)), [len(of_joint) for of_joint in columns])

    def rotations(self, angles: NDArray[np.floating]) -> Array:
        """Joint rotations (..., J, 3, 3), in the order of ``KinematicTree.tree_joints``, of angles (..., A) [rad]."""
        rotations = np.empty((*angles.shape[:-1], len(self.tree.tree_joints), 3, 3))
        rotations[...] = np.eye(3)
        rotations[..., self._balls, :, :] = self._order.compose(angles[..., self._ball_columns])
        for row, column in zip(self._hinges, self._hinge_columns, strict=True):
            rotations[..., row, :, :] = self.tree.tree_joints[row].hinge_rotation(angles[..., column])
        return rotations

    def poses(self, angles: NDArray[np.floating]) -> Array:
        """``rotations`` as poses (..., J, 4, 4), with the places of free joints' children in their parents."""
        poses = np.zeros((*angles.shape[:-1], len(self.tree.tree_joints), 4, 4))
        poses[..., :3, :3], poses[..., 3, 3] = self.rotations(angles), 1.0
        places = poses[..., :3, 3]
        places[..., self._free, :] = angles[..., self._place_columns]
        return poses

    def forward_kinematics(self, world_T_root: Array, angles: NDArray[np.floating]) -> Array:
        """Poses world_T_segment (..., S, 4, 4) of the root's (..., 4, 4) and of angles (..., A)."""
        return self.tree.forward_kinematics(world_T_root, self.poses(angles))

    def angles(self, joint_motion: Array, previous: Array) -> Array:
        """Angles (..., A) of joint motions (..., J, 3, 3) or (..., J, 4, 4), nearest to previous angles (..., A).

        Rotations do not have the place of the child of a free joint: it stays where it was.
        """
        rotations, angles = joint_motion[..., :3, :3], np.empty((*joint_motion.shape[:-3], len(self.names)))
        places = joint_motion[..., :3, 3][..., self._free, :] if joint_motion.shape[-1] == 4 else None
        angles[..., self._place_columns] = previous[..., self._place_columns] if places is None else places
        balls = self._order.decompose(rotations[..., self._balls, :, :], previous[..., self._ball_columns])
        angles[..., self._ball_columns] = balls
        hinges = hinge_angle(rotations[..., self._hinges, :, :], self._hinge_axes)
        angles[..., self._hinge_columns] = nearest_turn(hinges, previous[..., self._hinge_columns])
        return angles

    def rates(self, angles: Array) -> Array:
        """(A, 3) how angles (A) [rad] grow with a turn w of their joint's rotation, R exp(w), in the child's axes."""
        rates = np.zeros((len(self.names), 3))
        rates[self._ball_columns] = self._order.rates(angles[self._ball_columns])
        rates[self._hinge_columns] = self._hinge_axes
        return rates


class JointAngleTracker:
    """Joint angles of a moving body, continuous over time: no jump at half a turn or between Euler triples.

    An angle that passes a full turn, 2 pi, drops that turn, unless its joint counts turns (``Joint.counts_turns``).

    Attributes:
        names: (A) of the angles, in the order of all that this class returns.
    """

    def __init__(self, body: KinematicTree) -> None:
        self._body = body
        self._joint_angles = JointAngles(body)
        self.names = self._joint_angles.names
        self._within_a_turn = angles_within_a_turn(body)
        self.reset()

    def reset(self) -> None:
        """Forget the past: the next angles are those nearest to the N-pose."""
        self._previous = np.zeros(len(self.names))

    def angles(self, world_T_segment: Array) -> Array:
        """Angles (A) of the segments' poses (S, 4, 4), the next instant after the last call's."""
        joint_poses = self._body.joint_poses(world_T_segment)
        angles = self._joint_angles.angles(joint_poses, self._previous)
        passed = self._within_a_turn & (np.abs(angles) > FULL_TURN)
        self._previous = np.where(passed, angles - np.copysign(FULL_TURN, angles), angles)
        return self._previous.copy()

    def change(self, previous: Array, angles: Array) -> Array:
        """Change (A) from one call's angles (A) to the next call's (A), with the turns that were dropped between."""
        return np.where(self._within_a_turn, nearest_turn(angles - previous, np.zeros(1)), angles - previous)


def angles_within_a_turn(body: KinematicTree) -> NDArray[np.bool_]:
    """(A) whether the published angle stays between -2 pi and 2 pi."""
    return np.array([not joint.counts_turns for joint in body.tree_joints for _ in joint.angle_names], dtype=bool)
