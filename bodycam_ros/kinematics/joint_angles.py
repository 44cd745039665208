"""Joint angles: the rotations of a body's joints as one vector of continuous angles, and back.

A ball joint is three angles whose middle axis is the child's long axis (DESIGN 3), named ``<joint>_<axis>`` in the
order of ``Joint.angle_axes``; a hinge is one angle, named as the joint; a weld is none. A free joint is a place,
``<joint>_at_x``, ``_at_y``, ``_at_z`` [m], and then the angles of a ball; both are meant by "angles" here.
"""

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.geometry import Array, adjoint, exp_so3, inverse, rigid
from bodycam_ros.kinematics.joint import FULL_TURN, hinge_angle
from bodycam_ros.kinematics.tree import KinematicTree

_SINGULAR = 1e-3  # cosine of the middle angle, about, below which the rates of the other two are no longer told apart

# [rad] Nearer than this to the singularity the first angle stays as it was. Noise would turn it by a radian at once,
# and what is lost of the rotation is at most as much as this.
_FROZEN = 1e-4

_PARITY = {"xyz": 1.0, "yzx": 1.0, "zxy": 1.0, "xzy": -1.0, "yxz": -1.0, "zyx": -1.0}


class EulerOrder:
    """The axes of N rotations, such as yzx for each: three angles a rotation, intrinsic about three different axes.

    R = R_i(first) R_j(middle) R_k(last), with i, j, k a permutation of x, y, z. Each rotation has two such triples; and
    at a middle angle of 90 degrees only the sum or the difference of the other two is determined. Both times the
    decomposition here stays near the angles of the previous state, so that angles do not jump while a limb moves.
    """

    def __init__(self, orders: tuple[str, ...]) -> None:
        self._axes = np.array([["xyz".index(axis) for axis in order] for order in orders], dtype=int).reshape(-1, 3)
        self._parity = np.array([_PARITY[order] for order in orders])
        self._rows = np.arange(len(orders))

    def compose(self, angles: NDArray[np.floating]) -> Array:
        """Rotations (..., N, 3, 3) of angles (..., N, 3) [rad]."""
        R = exp_so3(angles[..., None] * np.eye(3)[self._axes])
        rotations: Array = R[..., 0, :, :] @ R[..., 1, :, :] @ R[..., 2, :, :]
        return rotations

    def rates(self, angles: Array) -> Array:
        """(N, 3, 3) how angles (N, 3) [rad] grow with a turn w of their rotations, R exp(w); least at the singularity.

        Row by angle, column by component of w; the inverse of the Jacobian whose columns are the angles' axes in the
        axes of R.
        """
        first, middle, last = np.swapaxes(np.eye(3)[self._axes], 0, 1)
        R_last = exp_so3(angles[:, 2:] * last)
        R_middle = exp_so3(angles[:, 1:2] * middle) @ R_last
        turns = [(first[:, None] @ R_middle)[:, 0], (middle[:, None] @ R_last)[:, 0], last]
        return np.asarray(np.linalg.pinv(np.stack(turns, axis=2), rcond=_SINGULAR), np.float64)

    def decompose(self, rotations: Array, previous: Array) -> Array:
        """Angles (..., N, 3) [rad] of rotations (..., N, 3, 3), nearest to the previous angles (..., N, 3) [rad].

        Given the first angle, the other two follow without a singularity from R_i(first)^-1 R = R_j(middle) R_k(last).
        """
        rows, (i, j, k), parity = self._rows, self._axes.T, self._parity
        y, x = -parity * rotations[..., rows, j, k], rotations[..., rows, k, k]
        frozen = np.hypot(x, y) < _FROZEN  # the cosine of the middle angle
        first = np.where(frozen, previous[..., 0], np.arctan2(y, x))
        cosine, sine = np.cos(first)[..., None], (parity * np.sin(first))[..., None]
        row_j = cosine * rotations[..., rows, j, :] + sine * rotations[..., rows, k, :]
        row_k = cosine * rotations[..., rows, k, :] - sine * rotations[..., rows, j, :]
        middle = np.arctan2(parity * rotations[..., rows, i, k], row_k[..., rows, k])
        last = np.arctan2(parity * row_j[..., rows, i], row_j[..., rows, j])
        triple = np.stack([first, middle, last], axis=-1)
        # The other triple: half a turn about the first axis and the last, with the middle one mirrored.
        other = np.pi + np.array([1.0, -1.0, 1.0]) * triple
        triples = nearest_turn(np.stack([triple, other]), previous)
        distances = np.sum((triples - previous) ** 2, axis=-1)
        nearest: Array = np.where((distances[0] <= distances[1])[..., None], triples[0], triples[1])
        return nearest


def nearest_turn(angles: NDArray[np.floating], previous: NDArray[np.floating]) -> Array:
    """Angles (...) [rad] plus as many whole turns as bring them nearest to the previous ones (...) [rad]."""
    turns: Array = angles - 2.0 * np.pi * np.round((angles - previous) / (2.0 * np.pi))
    return turns


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
        # The last three of a free joint's six are a ball's.
        self._ball_columns = np.array([columns[row][-3:] for row in self._balls], dtype=int).reshape(-1, 3)
        self._free = [row for row, joint in enumerate(tree.tree_joints) if joint.type == "free"]
        self._place_columns = np.array([columns[row][:3] for row in self._free], dtype=int).reshape(-1, 3)
        self._hinge_columns = np.array([columns[row][0] for row in self._hinges], dtype=int)
        self._hinge_axes = np.array([tree.tree_joints[row].axis for row in self._hinges]).reshape(-1, 3)
        joints = tree.tree_joints
        self._parent_T_joint = np.array([joint.parent_T_joint for joint in joints]).reshape(-1, 4, 4)
        self._child_T_joint = np.array([joint.child_T_joint for joint in joints]).reshape(-1, 4, 4)
        self._order = EulerOrder(tuple(tree.tree_joints[row].angle_axes for row in self._balls))
        self.joint_rows = np.repeat(np.arange(len(columns)), [len(of_joint) for of_joint in columns])

    def rotations(self, angles: NDArray[np.floating]) -> Array:
        """Joint rotations (..., J, 3, 3), in the order of ``KinematicTree.tree_joints``, of angles (..., A) [rad]."""
        rotations = np.empty((*angles.shape[:-1], len(self.tree.tree_joints), 3, 3))
        rotations[...] = np.eye(3)
        rotations[..., self._balls, :, :] = self._order.compose(angles[..., self._ball_columns])
        rotations[..., self._hinges, :, :] = exp_so3(angles[..., self._hinge_columns, None] * self._hinge_axes)
        return rotations

    def poses(self, angles: NDArray[np.floating]) -> Array:
        """``rotations`` as poses (..., J, 4, 4), with the places of free joints' children in their parents."""
        places = np.zeros((*angles.shape[:-1], len(self.tree.tree_joints), 3))
        places[..., self._free, :] = angles[..., self._place_columns]
        return rigid(self.rotations(angles), places)

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

    def velocities(self, world_T_segment: Array, twists: Array, angles: Array) -> Array:
        """Rates (A) of angles [rad/s] and of places [m/s].

        Args:
            world_T_segment: (S, 4, 4) poses.
            twists: (S, 6) velocities of the segments, angular [rad/s] then linear [m/s], in the segments' axes.
            angles: (A) of the poses.
        """
        parents, children = self.tree.joint_ends.T
        on_parent, on_child = (
            world_T_segment[parents] @ self._parent_T_joint,
            world_T_segment[children] @ self._child_T_joint,
        )
        parent_T_child = inverse(on_parent) @ on_child
        # Twists of the joint's frames on the two segments, in their own axes.
        of_parent = (adjoint(inverse(self._parent_T_joint)) @ twists[parents, :, None])[..., 0]
        of_child = (adjoint(inverse(self._child_T_joint)) @ twists[children, :, None])[..., 0]
        child_R_parent, origin = np.swapaxes(parent_T_child[:, :3, :3], 1, 2), parent_T_child[:, :3, 3]
        turning = of_child[:, :3] - (child_R_parent @ of_parent[:, :3, None])[..., 0]
        moving = (parent_T_child[:, :3, :3] @ of_child[:, 3:, None])[..., 0]
        moving -= of_parent[:, 3:] + np.cross(of_parent[:, :3], origin)
        velocities: Array = (self.rates(angles) * turning[self.joint_rows]).sum(axis=1)
        velocities[self._place_columns] = moving[self._free]
        return velocities


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
        """Angles (A) of the segments' poses (S, 4, 4), the next state after the last call's."""
        joint_poses = self._body.joint_poses(world_T_segment)
        angles = self._joint_angles.angles(joint_poses, self._previous)
        passed = self._within_a_turn & (np.abs(angles) > FULL_TURN)
        self._previous = np.where(passed, angles - np.copysign(FULL_TURN, angles), angles)
        return self._previous.copy()

    def velocities(self, world_T_segment: Array, twists: Array) -> Array:
        """Rates (A) of the latest angles, as ``JointAngles.velocities``."""
        return self._joint_angles.velocities(world_T_segment, twists, self._previous)


def angles_within_a_turn(body: KinematicTree) -> NDArray[np.bool_]:
    """(A) whether the published angle stays between -2 pi and 2 pi."""
    return np.array([not joint.counts_turns for joint in body.tree_joints for _ in joint.angle_names], dtype=bool)


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
        """Excess (..., A) of angles (..., A) [rad] above their limits; negative below, zero within."""
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

    def nearest_angles(self, rotations: Array) -> Array:
        """Angles (A) [rad] of joint motions (J, 3, 3) or (J, 4, 4), of all triples and turns those nearest to zero."""
        return self.angles.angles(rotations, self._at_rest)
