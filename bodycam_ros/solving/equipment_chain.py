"""The equipment as a kinematic chain: a root, and joints that turn or slide along twists (B eq. 3-4)."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.equipment.equipment import Equipment
from bodycam_ros.equipment.unknown_lengths import UnknownLengths
from bodycam_ros.geometry import adjoint, exp_se3, inverse, nearest_rotation
from bodycam_ros.kinematics.joint import LOOSE_M, LOOSE_RAD, TIGHT_M, TIGHT_RAD, Joint

Array = NDArray[np.float64]

_HELD_RAD, _HELD_M = 10.0 * TIGHT_RAD, 10.0 * TIGHT_M
"""A joint does not move at all along what its sigmas hold tighter."""


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
    columns: NDArray[np.intp]


class EquipmentChain:
    """Poses of the equipment's segments as functions of its root, its joints and its lengths.

    Args:
        equipment: its segments.
        tree: its own joints, parents first.
        lengths: what is unknown of it.

    Attributes:
        row: segment -> its row among the equipment's.
        root: row of the root.
        freedoms: of the joints, parents first.
        length_columns: (L) of the lengths among the unknowns; a tangent of the root comes first, then the joints.
        count: of all unknowns of an instant.
    """

    def __init__(self, equipment: Equipment, tree: Sequence[Joint], lengths: UnknownLengths) -> None:
        self._lengths = lengths
        self.row = {name: row for row, name in enumerate(equipment.segments)}
        self.root = self.row[equipment.root]
        self.freedoms: list[Freedom] = []
        count = 6
        for joint in tree:
            twists, sigmas = _freedom(joint)
            self.freedoms.append(Freedom(joint, twists, sigmas, count + np.arange(len(sigmas))))
            count += len(sigmas)
        self.length_columns = count + np.arange(len(lengths))
        self.count = count + len(lengths)

    def motions(self, poses: Array, lengths: Array) -> list[Array]:
        """How each joint stands (T, 4, 4), of poses (T, E, 4, 4) and lengths (L): what joints hold is dropped."""
        motions = []
        for f in self.freedoms:
            joint = self._lengths.joint(f.joint, lengths)
            world_T_joint = poses[:, self.row[joint.parent]] @ joint.parent_T_joint
            motion = inverse(world_T_joint) @ poses[:, self.row[joint.child]] @ joint.child_T_joint
            motion[:, :3, :3] = joint.permitted_rotation(motion[:, :3, :3])
            motion[:, :3, 3] *= f.twists[3:].any(axis=1)
            motions.append(motion)
        return motions

    def moved(self, root: Array, motions: Sequence[Array], step: Array) -> tuple[Array, list[Array]]:
        """Root (T, 4, 4) and joints (T, 4, 4) after a step (T, n) of the unknowns."""
        return _orthonormal(root @ exp_se3(step[:, :6])), [
            _orthonormal(motion @ exp_se3(step[:, f.columns] @ f.twists.T)) if len(f.columns) else motion
            for f, motion in zip(self.freedoms, motions, strict=True)
        ]

    def poses(self, root: Array, motions: Sequence[Array], lengths: Array) -> tuple[Array, Array]:
        """Poses (T, E, 4, 4), and how their tangents follow from the unknowns (T, E, 6, n) (B eq. 3)."""
        poses = np.empty((len(root), len(self.row), 4, 4))
        J = np.zeros((len(root), len(self.row), 6, self.count))
        poses[:, self.root] = root
        J[:, self.root, :, :6] = np.eye(6)
        for f, motion in zip(self.freedoms, motions, strict=True):
            joint, p, c = self._lengths.joint(f.joint, lengths), self.row[f.joint.parent], self.row[f.joint.child]
            parent_T_child = joint.parent_T_joint @ motion @ joint.joint_T_child
            poses[:, c] = poses[:, p] @ parent_T_child
            J[:, c] = adjoint(inverse(parent_T_child)) @ J[:, p]
            J[:, c, :, f.columns] = np.moveaxis(adjoint(joint.child_T_joint) @ f.twists, -1, 0)[:, None]
            for number, axis in self._lengths.of(joint.name):
                # A shift of the joint on its parent moves the child along.
                J[:, c, 3:, self.length_columns[number]] += parent_T_child[:, axis, :3]
        return poses, J


def closed_but_sliding(joint: Joint, parent_T_child: Array) -> Array:
    """The pose (4, 4) of a child that closes its joint as it stands (4, 4): what slides stays where it has slid to."""
    closed = joint.measured_relative_pose(parent_T_child)
    slides = np.array(joint.sigmas)[3:] > _HELD_M
    if not slides.any():
        return closed
    joint_T_end = inverse(joint.parent_T_joint) @ parent_T_child @ joint.child_T_joint
    motion = inverse(joint.parent_T_joint) @ closed @ joint.child_T_joint
    motion[:3, 3] = np.where(slides, joint_T_end[:3, 3], 0.0)
    return np.asarray(joint.parent_T_joint @ motion @ joint.joint_T_child)


def _freedom(joint: Joint) -> tuple[Array, Array]:
    """Twists (6, F) along which a joint moves, in its frame, and how far (F): infinite where there is no opinion."""
    sigmas = np.array(joint.sigmas)
    axes = np.eye(6)
    axes[:3, :3] = joint.axes_of_rotation.T
    free = sigmas > np.repeat([_HELD_RAD, _HELD_M], 3)
    loose = sigmas >= np.repeat([LOOSE_RAD, LOOSE_M], 3)
    # What a hinge or a weld holds softly is no freedom of a machine.
    turns = {"ball": 3, "free": 3, "hinge": 1}.get(joint.type, 0)
    free[:3] = loose[:3] = np.arange(3) < turns
    return axes[:, free], np.where(loose, np.inf, sigmas)[free]


def _orthonormal(poses: Array) -> Array:
    poses[..., :3, :3] = nearest_rotation(poses[..., :3, :3])
    return poses
