"""The equipment as a kinematic tree whose root, joints and unknown lengths are estimated (B eq. 3-4)."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.equipment.equipment import Equipment
from bodycam_ros.equipment.unknown_lengths import UnknownLengths
from bodycam_ros.estimation.measurements import SLIDES_M
from bodycam_ros.kinematics.joint import LOOSE_M, Joint
from bodycam_ros.kinematics.tangent import TreeTangent
from bodycam_ros.kinematics.tree import KinematicTree

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Freedom:
    """How a joint of the equipment moves.

    Attributes:
        joint: which.
        twists: (6, F) the directions in the joint's frame that are free.
        sigmas: (F) how far along them [rad], [m]; infinite where there is no opinion.
        columns: (F) among the unknowns of an instant.
    """

    joint: Joint
    twists: Array
    sigmas: Array
    columns: slice


class EquipmentChain:
    """Poses of the equipment's segments as functions of its root, its joints and its lengths.

    Args:
        equipment: its segments.
        tree: its own joints.
        lengths: what is unknown of it.

    Attributes:
        tree: its segments and joints.
        row: segment -> its row among the equipment's.
        root: row of the root.
        slides: (J, 3) along which axes its joints slide.
        freedoms: (J) of the joints, in the order of the tree.
        length_columns: (L) of the lengths among the unknowns; a tangent of the root comes first, then the joints.
        count: of all unknowns of an instant.
    """

    def __init__(self, equipment: Equipment, tree: Sequence[Joint], lengths: UnknownLengths) -> None:
        self.tree = KinematicTree(equipment.name, equipment.root, tuple(equipment.segments), tuple(tree))
        self._tangent, self._lengths = TreeTangent(self.tree, SLIDES_M), lengths
        self.row, self.root = self.tree.segment_index, self.tree.segment_index[equipment.root]
        joints, twists, columns = self.tree.tree_joints, self._tangent.twists, self._tangent.columns
        self.slides = np.array([xi[3:].any(axis=1) for xi in twists], bool).reshape(-1, 3)
        sigmas = [np.array(joint.sigmas)[list(joint.free_rows(SLIDES_M))] for joint in joints]
        # What turns freely, or slides freely, has no sigma.
        sigmas = [
            np.where(xi[:3].any(axis=0) | (own >= LOOSE_M), np.inf, own) for xi, own in zip(twists, sigmas, strict=True)
        ]
        self.freedoms = [Freedom(*each) for each in zip(joints, twists, sigmas, columns, strict=True)]
        self.length_columns = self._tangent.count + np.arange(len(lengths))
        self.count = self._tangent.count + len(lengths)

    def motions(self, poses: Array, lengths: Array) -> Array:
        """Joint motions (T, J, 4, 4) of poses (T, E, 4, 4) and lengths (L): what joints hold is dropped."""
        motions = self.tree.joint_poses(poses, np.ones_like(self.slides))
        motions[..., :3, 3] = self.slides * (motions[..., :3, 3] - self._shifts(lengths))
        return motions

    def moved(self, root: Array, motions: Array, step: Array) -> tuple[Array, Array]:
        """Root (T, 4, 4) and joint motions (T, J, 4, 4) after a step (T, n) of the unknowns."""
        return self._tangent.moved(root, motions, step)

    def poses(self, root: Array, motions: Array, lengths: Array) -> tuple[Array, Array]:
        """Poses (T, E, 4, 4), and how their tangents follow from the unknowns (T, E, 6, n) (B eq. 3)."""
        longer = motions.copy()
        longer[..., :3, 3] += self._shifts(lengths)
        poses = self.tree.forward_kinematics(root, longer)
        J = np.zeros((*poses.shape[:-2], 6, self.count))
        J[..., : self._tangent.count] = self._tangent.segment_jacobians(poses)
        for row, joint in enumerate(self.tree.tree_joints):
            for number, axis in self._lengths.of(joint.name):
                column = slice(self.length_columns[number], self.length_columns[number] + 1)
                # A shift of the joint on its parent moves all that hangs on it along.
                below, along = self.tree.moves[:, row], poses[:, self.row[joint.parent], :3, axis]
                segment_R_world = np.swapaxes(poses[:, below, :3, :3], -1, -2)
                J[:, below, 3:, column] = segment_R_world @ along[:, None, :, None]
        return poses, J

    def _shifts(self, lengths: Array) -> Array:
        """(J, 3) by how much joints are elsewhere on their parents than given, in the joints' axes [m]."""
        shifts = [self._lengths.along_axes(j.name, lengths) @ j.parent_T_joint[:3, :3] for j in self.tree.tree_joints]
        return np.array(shifts).reshape(-1, 3)
