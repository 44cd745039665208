"""Jacobians of a tree: how poses, points and gaps of loops change with a local increment of its coordinates.

An increment (K) is a twist of the root, then of each joint of the tree the amounts along its free twists (B eq. 4). It
acts on the right, in moving frames: ``world_T_root @ exp_se3(step[:6])`` and ``joint_motion @ exp_se3(twists @ part)``.
Tangents of segments are on the right as well, in the segments' axes, rotation first [rad], then translation [m].

In the world's axes a joint moves all that hangs on it by one and the same twist, Ad(world_T_joint) xi: B eq. 7 with
exp(theta xi) linearised, its set of joints that affect a point being ``KinematicTree.moves``.

The gap is that of the joint's frames on the two segments, ``parent_joint_T_child_joint``: the rotation that the type
forbids, about the rows' axes, then the place of the one frame in the other.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.geometry import Array, adjoint, exp_so3, hat, inverse, log_jacobian, log_so3
from bodycam_ros.kernels import as_rows
from bodycam_ros.kinematics.joint import LOOSE_M, Joint, hinge_angle
from bodycam_ros.kinematics.tree import KinematicTree
from bodycam_ros.kinematics.tree_kernels import (
    moved_motion,
    segment_tangents,
    step_jacobian,
    steps_between,
)

GIVES_RAD, GIVES_M = 1.0, 0.25
"""A sigma of this size or more holds nothing: a seat that slides has one, a strap or a soft sole does not."""


def held_rows(joint: Joint) -> tuple[int, ...]:
    """Which of its six rows, rotation first and a hinge's own axis before those across it, the joint holds."""
    assert joint.sigmas is not None  # set when it was made
    gives, free = np.repeat([GIVES_RAD, GIVES_M], 3), joint.free_rows(GIVES_M)
    return tuple(row for row in range(6) if row not in free and joint.sigmas[row] < gives[row])


class LoopGaps:
    """Gaps of L joints between segments of a tree, all at once.

    Args:
        tree: with both segments of each.
        joints: of these types; free ones hold nothing.

    Attributes:
        sigmas: (L, 6) of the gaps [rad], [m].
    """

    def __init__(self, tree: KinematicTree, joints: Sequence[Joint]) -> None:
        index, count = tree.segment_index, len(joints)
        self._parents, self._children = (
            [index[segment] for segment in ends] for ends in ([j.parent for j in joints], [j.child for j in joints])
        )
        self._joint_T_parent = inverse(np.array([joint.parent_T_joint for joint in joints]).reshape(-1, 4, 4))
        self._child_T_joint = np.array([joint.child_T_joint for joint in joints]).reshape(-1, 4, 4)
        self._joint_from_parent = adjoint(self._joint_T_parent)
        self._joint_from_child = adjoint(inverse(self._child_T_joint))
        self._axes = np.array([joint.axes_of_rotation for joint in joints]).reshape(-1, 3, 3)
        self.sigmas = np.array([joint.sigmas for joint in joints]).reshape(-1, 6)
        types = np.array([joint.type for joint in joints], np.str_)
        self._turning, self._hinges = (np.isin(types, ("ball", "free")), np.flatnonzero(types == "hinge"))
        self._hinge_axes = np.array([joint.axis for joint in joints]).reshape(count, 3)[self._hinges]

    def jacobians(self, world_T_segment: Array) -> tuple[Array, Array, Array]:
        """Gaps (L, 6) at poses (S, 4, 4), and how they change with tangents of parents and children: (L, 6, 6) each.

        Rows as in ``Joint.sigmas``; tangents in the segments' own axes.
        """
        gap = self._joint_T_parent @ inverse(world_T_segment[self._parents])
        gap = gap @ world_T_segment[self._children] @ self._child_T_joint
        gap_inverse, (forbidden, by_turn) = inverse(gap), self._forbidden(gap[:, :3, :3])
        by_gap = np.zeros((len(gap), 6, 6))
        by_gap[:, :3, :3] = self._axes @ by_turn
        by_gap[:, 3:, :3], by_gap[:, 3:, 3:] = hat(-gap_inverse[:, :3, 3]), np.eye(3)
        residual = np.concatenate([(self._axes @ forbidden[..., None])[..., 0], -gap_inverse[:, :3, 3]], axis=1)
        by_parent = -by_gap @ adjoint(gap_inverse) @ self._joint_from_parent
        return residual, by_parent, by_gap @ self._joint_from_child

    def linearised(self, world_T_segment: Array, J: Array) -> tuple[Array, Array]:
        """Gaps (L, 6) at poses (S, 4, 4), and their Jacobians (L, 6, K) by those of the segments (S, 6, K)."""
        gaps, by_parent, by_child = self.jacobians(world_T_segment)
        return gaps, by_parent @ J[self._parents] + by_child @ J[self._children]

    def _forbidden(self, R: Array) -> tuple[Array, Array]:
        """Rotation vectors (L, 3) of what the types forbid, and how turns of the children change them (L, 3, 3)."""
        swing = R.copy()
        hinges = self._hinges
        axes = self._hinge_axes
        swing[hinges] = exp_so3(-hinge_angle(R[hinges], axes)[:, None] * axes) @ R[hinges]
        swing[self._turning] = np.eye(3)
        forbidden = log_so3(swing)
        J = log_jacobian(-forbidden)
        J[self._turning] = 0.0
        # A hinge's own angle follows, so that nothing of the swing is about the axis.
        J_hinge, axes = J[hinges], axes[..., None]
        of_axis = J_hinge @ np.swapaxes(swing[hinges], -1, -2) @ axes
        along = np.swapaxes(axes, -1, -2) @ J_hinge / (np.swapaxes(axes, -1, -2) @ of_axis)
        J[hinges] = J_hinge - of_axis @ along
        return forbidden, J


class TreeTangent:
    """Increments of the coordinates of a tree, and their Jacobians.

    Args:
        tree: segments and joints.
        slide_m: a joint slides along the axes whose sigma is this or more [m].

    Attributes:
        tree: as given.
        twists: of each joint of the tree, (6, F) in its frame.
        columns: of each joint of the tree, its columns of an increment; the root's are the first six.
        child_turns: (J, 3, K) how joint rotations turn, about the axes of the child.
        slides: (J, 3) along which axes joints slide.
        turns: (K) columns that turn; the others shift.
        root: row of the root.
        count: K.
    """

    def __init__(self, tree: KinematicTree, slide_m: float = LOOSE_M) -> None:
        self.tree = tree
        self.twists = [joint.free_twists(slide_m) for joint in tree.tree_joints]
        self.slides = np.array([xi[3:].any(axis=1) for xi in self.twists], bool).reshape(-1, 3)
        ends = 6 + np.cumsum([0, *(twists.shape[1] for twists in self.twists)])
        self.columns = [slice(int(start), int(end)) for start, end in zip(ends[:-1], ends[1:], strict=True)]
        self.count = int(ends[-1])
        self.child_turns = np.zeros((len(self.twists), 3, self.count))
        for row, (joint, columns) in enumerate(zip(tree.tree_joints, self.columns, strict=True)):
            self.child_turns[row, :, columns] = joint.child_T_joint[:3, :3] @ self.twists[row][:3]
        self._carriers = np.append(np.zeros(6, np.int64), 1 + np.repeat(np.arange(len(self.twists)), np.diff(ends)))
        self._of_columns = np.concatenate([np.eye(6), *(twists.T for twists in self.twists)])
        self.turns = np.asarray(self._of_columns[:, :3].any(axis=1), bool)
        moves = np.concatenate([np.ones((len(tree.segments), 1)), tree.moves], axis=1)
        self._moves = np.ascontiguousarray(moves[:, self._carriers])
        child_twists = [(adjoint(j.child_T_joint) @ xi).T for j, xi in zip(tree.tree_joints, self.twists, strict=True)]
        self._child_twists = np.concatenate([np.eye(6), *child_twists])
        self._all_rows = np.arange(len(tree.segments))
        self.root = tree.segment_index[tree.root]
        self._child_of_column = np.append(self.root, tree.joint_ends[:, 1])[self._carriers]

    def moved(self, motion: Array, step: Array) -> Array:
        """Motions (..., 1 + J, 4, 4) of the root and of all joints (``all_motion``) after an increment (..., K)."""
        rows, steps = motion.reshape(-1, *motion.shape[-3:]), as_rows(step[..., : self.count].reshape(-1, self.count))
        moved: Array = moved_motion(rows, steps, self._of_columns, self._carriers).reshape(motion.shape)
        return moved

    def step_between(self, motion: Array, to: Array) -> Array:
        """The increment (..., K) that moves motions (..., 1 + J, 4, 4) of the root and of all joints to others."""
        start, end = (each.reshape(-1, *each.shape[-3:]) for each in (motion, to))
        steps: Array = steps_between(start, end, self._of_columns, self._carriers)
        return steps.reshape(*motion.shape[:-3], self.count)

    def step_jacobian(self, step: Array) -> Array:
        """(K, K) how the motions after an increment (K) move, by an increment of theirs, when the first one changes."""
        jacobian: Array = step_jacobian(as_rows(step), self._of_columns, self._carriers, 1 + len(self.twists))
        return jacobian

    def columns_of(self, joints: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """(K,) columns of some joints (J,) of the tree."""
        return np.concatenate([np.zeros(6, bool), joints[self._carriers[6:] - 1]])

    def segment_jacobians(self, world_T_segment: Array, rows: Sequence[int] | None = None) -> Array:
        """(..., S, 6, K) how the poses (..., S, 4, 4) change, or those of some rows: tangents in the segments' axes."""
        poses = as_rows(world_T_segment.reshape(-1, *world_T_segment.shape[-3:]))
        wanted = self._all_rows if rows is None else np.array(rows, np.int64)
        tangents: Array = segment_tangents(poses, wanted, self._child_twists, self._child_of_column, self._moves)
        return tangents.reshape(*world_T_segment.shape[:-3], *tangents.shape[1:])
