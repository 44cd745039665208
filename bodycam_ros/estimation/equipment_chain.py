"""Poses of equipment from its root, its joints and its unknown lengths (B eq. 3)."""

from collections.abc import Sequence

import numpy as np

from bodycam_ros.body.equipment import Equipment, UnknownLengths
from bodycam_ros.estimation.measurements import SLIDES_M
from bodycam_ros.geometry import Array
from bodycam_ros.kinematics.joint import LOOSE_M, Joint
from bodycam_ros.kinematics.tangent import TreeTangent
from bodycam_ros.kinematics.tree import KinematicTree


class EquipmentChain:
    """A tree of the equipment alone, whose joints may be shifted by unknown lengths.

    Args:
        equipment: its segments.
        tree: its own joints.
        lengths: (L) what is unknown of it.

    Attributes:
        tree: its segments and joints.
        row: segment -> its row among the equipment's.
        root: row of the root.
        slides: (J, 3) along which axes its joints slide.
        twists: of each joint (6, F), the free directions in its frame.
        sigmas: of each joint (F), how far along them [rad], [m]; infinite where it is free.
        columns: of each joint, its columns among the unknowns of one time.
        length_columns: (L) of the lengths; a tangent of the root comes first, then the joints, then the lengths.
        count: n, of all unknowns of one time.
    """

    def __init__(self, equipment: Equipment, tree: Sequence[Joint], lengths: UnknownLengths) -> None:
        self.tree = KinematicTree(equipment.name, equipment.root, tuple(equipment.segments), tuple(tree))
        self._tangent, self._lengths = TreeTangent(self.tree, SLIDES_M), lengths
        self.row, self.root = self.tree.segment_index, self.tree.segment_index[equipment.root]
        self.twists, self.columns = self._tangent.twists, self._tangent.columns
        self.slides = self._tangent.slides
        self.sigmas = []
        for joint, xi in zip(self.tree.tree_joints, self.twists, strict=True):
            own = np.array(joint.sigmas)[list(joint.free_rows(SLIDES_M))]
            self.sigmas.append(np.where(xi[:3].any(axis=0) | (own >= LOOSE_M), np.inf, own))
        self.length_columns = self._tangent.count + np.arange(len(lengths))
        self.count = self._tangent.count + len(lengths)

    def motions(self, poses: Array, lengths: Array) -> Array:
        """Joint motions (T, J, 4, 4) of poses (T, E, 4, 4) and lengths (L), without what the joints forbid."""
        motions = self.tree.joint_poses(poses, np.ones_like(self.slides))
        motions[..., :3, 3] = self.slides * (motions[..., :3, 3] - self._shifts(lengths))
        return motions

    def moved(self, root: Array, motions: Array, step: Array) -> tuple[Array, Array]:
        """Root (T, 4, 4) and joint motions (T, J, 4, 4) after a step (T, n) of the unknowns."""
        return self._tangent.moved(root, motions, step)

    def poses(self, root: Array, motions: Array, lengths: Array) -> tuple[Array, Array]:
        """Poses (T, E, 4, 4), and their Jacobian (T, E, 6, n) with tangents in the segments' axes."""
        longer = motions.copy()
        longer[..., :3, 3] += self._shifts(lengths)
        poses = self.tree.forward_kinematics(root, longer)
        J = np.zeros((*poses.shape[:-2], 6, self.count))
        J[..., : self._tangent.count] = self._tangent.segment_jacobians(poses)
        for row, joint in enumerate(self.tree.tree_joints):
            for number, axis in self._lengths.columns(joint.name):
                column = slice(self.length_columns[number], self.length_columns[number] + 1)
                # A shift of the joint on its parent moves all segments below it along.
                below, along = self.tree.moves[:, row], poses[:, self.row[joint.parent], :3, axis]
                segment_R_world = np.swapaxes(poses[:, below, :3, :3], -1, -2)
                J[:, below, 3:, column] = segment_R_world @ along[:, None, :, None]
        return poses, J

    def _shifts(self, lengths: Array) -> Array:
        """(J, 3) shifts of the joints on their parents, in the joints' axes [m]."""
        shifts = [self._lengths.along_axes(j.name, lengths) @ j.parent_T_joint[:3, :3] for j in self.tree.tree_joints]
        return np.array(shifts).reshape(-1, 3)
