"""A body and its equipment as one tree with loops, and the constraint rows that close the loops (B 3.2).

An unknown length of the equipment is a sliding joint: a joint with an unknown place slides, and an attachment with an
unknown place is on a small segment of its own that slides on the equipment's.
"""

from collections.abc import Collection, Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.coupled_body import coupled_body
from bodycam_ros.body.equipment import Equipment, fitted_equipment
from bodycam_ros.geometry import Array, hat, inverse, log_se3, log_so3
from bodycam_ros.kinematics.joint import LOOSE_M, Joint
from bodycam_ros.kinematics.joint_angles import JointLimits
from bodycam_ros.kinematics.tangent import GIVES_M, GIVES_RAD, TreeTangent, held_rows, turn_jacobian
from bodycam_ros.kinematics.tree import KinematicTree

_GROUND_SIGMA = 1e-4  # [rad] and [m] of a segment that stands still
_LIMB_M = 0.4  # a column that slides by this counts as one that turns by a radian
_POSTURE_RAD, _LEAN_RAD, _LIMIT_RAD = 1.0, 0.5, 0.03  # sigmas of joints' rotations, of the root's, and beyond limits
_KNOWN_M = 1e-6  # least sigma of a length along an axis


@dataclass(frozen=True, eq=False)
class Configuration:
    """The coordinates: pose of the root (4, 4) and joint motions (J, 4, 4)."""

    world_T_root: Array
    joint_motion: Array


@dataclass(frozen=True, eq=False)
class Rows:
    """Constraint rows in units of sigma.

    Attributes:
        owners: (R) the joint, or the segment on the ground, that each row is of.
        directions: (R, 3) of each row in the world.
        turns: (R) whether it constrains a rotation.
        residuals: (R).
        jacobian: (R, K).
    """

    owners: tuple[str, ...]
    directions: Array
    turns: NDArray[np.bool_]
    residuals: Array
    jacobian: Array

    @classmethod
    def stack(cls, parts: Iterable["Rows"], columns: int) -> "Rows":
        """Several rows of so many columns as one."""
        parts = [cls((), np.zeros((0, 3)), np.zeros(0, bool), np.zeros(0), np.zeros((0, columns))), *parts]
        owners = tuple(owner for part in parts for owner in part.owners)
        arrays = [(part.directions, part.turns, part.residuals, part.jacobian) for part in parts]
        return cls(owners, *(np.concatenate(of_all) for of_all in zip(*arrays, strict=True)))


class Mechanism:
    """Columns and rows of a body, with equipment or alone.

    Attributes:
        body: both as one (``coupled_body``).
        equipment: as far as the body can hold it, or None.
        tree: the body's, with a segment for each attachment of unknown place.
        lengths: joint of the tree that slides by an unknown length -> (3) its sigmas, in the parent's axes [m].
        names: (K) of the joint, or of the root segment, that each column is of.
        kinds: (K) "place" of a segment that hangs on nothing, "joint" or "length".
        units: (K) 1 for a rotation, a limb's length [m] for a translation: in these units columns are alike.
        grounded: segments of the equipment that do not move in the world.

    Raises:
        BodyError: the equipment does not fit the body.
    """

    def __init__(self, body: BodyModel, equipment: Equipment | None = None) -> None:
        self.equipment = equipment = None if equipment is None else fitted_equipment(equipment, body)
        self.body = coupled_body(body, equipment)
        attachments = () if equipment is None else equipment.attachments
        unknown = {a.name: a.unknown for a in attachments} | dict(equipment.unknown if equipment else {})
        self.lengths = {name: np.asarray(sigma) for name, sigma in unknown.items() if np.any(sigma)}
        on_own = {joint.name for joint in self.body.loop_joints if joint.name in self.lengths}
        joints, places = [], []
        for joint in self.body.joints:
            if joint.name in on_own:
                place = f"{joint.name} place"
                places.append(_sliding(Joint(joint.name, joint.parent, place, "weld", np.eye(4))))
                joints.append(replace(joint, name=f"{joint.name} loop", parent=place))
            else:
                joints.append(_sliding(joint) if joint.name in self.lengths else joint)
        segments = (*self.body.segments, *(joint.child for joint in places))
        self.tree = KinematicTree(self.body.name, self.body.root, segments, (*joints, *places))
        self.tangent = TreeTangent(self.tree, GIVES_M)
        self.loops = {joint.name.removesuffix(" loop"): joint for joint in self.tree.loop_joints}
        twists = [(self.body.root, "place", np.eye(6))]
        for joint, xi in zip(self.tree.tree_joints, self.tangent.twists, strict=True):
            twists.append((joint.name, "place" if joint.type == "free" else "joint", xi))
        sliding = np.concatenate([xi[3:].any(axis=0) for _, _, xi in twists])
        self.names = np.array([name for name, _, xi in twists for _ in xi.T])
        kinds = np.array([kind for _, kind, xi in twists for _ in xi.T])
        self.kinds = np.where(sliding & np.isin(self.names, list(self.lengths)), "length", kinds)
        self.units = np.where(sliding, _LIMB_M, 1.0)
        beside = equipment.segments if equipment else {}
        self.grounded = tuple(name for name, motion in beside.items() if motion.stands)
        self.is_upright = equipment is not None and equipment.upright_sigma < GIVES_RAD
        self.only_upright = self.is_upright and equipment is not None and equipment.root not in self.grounded
        self.limits = JointLimits(self.tree)
        own = {*self.lengths, *(joint.name for joint in (equipment.joints if equipment else ()))}
        self._posture = [r for r, j in enumerate(self.tree.tree_joints) if j.type != "free" and j.name not in own]

    def columns(self, *kinds: str, names: Collection[str] | None = None) -> NDArray[np.intp]:
        """Indices of the columns of some kinds, and of some names."""
        chosen = np.isin(self.kinds, kinds)
        return np.flatnonzero(chosen if names is None else chosen & np.isin(self.names, list(names)))

    def resting(self, bent: float = 0.0) -> Configuration:
        """The N-pose, or joints bent by a share of the way to the middle of their limits; the roots at one place."""
        motion = np.tile(np.eye(4), (len(self.tree.tree_joints), 1, 1))
        motion[:, :3, :3] = self.limits.middle(bent)
        return Configuration(np.eye(4), motion)

    def moved(self, configuration: Configuration, step: Array) -> Configuration:
        """After an increment (K) of the columns."""
        return Configuration(*self.tangent.moved(configuration.world_T_root, configuration.joint_motion, step))

    def poses(self, configuration: Configuration) -> Array:
        """world_T_segment (S, 4, 4) of the tree, the body's segments first."""
        return self.tree.forward_kinematics(configuration.world_T_root, configuration.joint_motion)

    def longer_by(self, configuration: Configuration) -> dict[str, Array]:
        """Unknown length -> by how much (3) it is more than given, along the axes of the equipment's segment [m]."""
        rows = [(name, self.tree.joint_row[name]) for name in self.lengths]
        joints, motion = self.tree.tree_joints, configuration.joint_motion
        return {name: joints[row].parent_T_joint[:3, :3] @ motion[row, :3, 3] for name, row in rows}

    def constraints(
        self, configuration: Configuration, without: Collection[str] = (), ground: Array | None = None
    ) -> Rows:
        """Rows of the loops but some, of what may not lean and, given poses (S, 4, 4), of segments that stand there."""
        poses = self.poses(configuration)
        J, index, parts = self.tangent.segment_jacobians(poses), self.tree.segment_index, []
        for name, joint in self.loops.items():
            if name not in without:
                gap, by_step = self.tangent.gap(joint, poses, J)
                world_R_joint = poses[index[joint.child], :3, :3] @ joint.child_T_joint[:3, :3]
                axes = np.concatenate([joint.axes_of_rotation @ world_R_joint.T, world_R_joint.T])
                parts.append(_rows(name, gap, by_step, np.array(joint.sigmas), axes, held_rows(joint)))
        for segment in self.grounded if ground is not None else ():
            assert ground is not None
            row = index[segment]
            away, axes = log_se3(inverse(ground[row]) @ poses[row]), np.tile(poses[row, :3, :3].T, (2, 1))
            parts.append(_rows(segment, away, J[row], np.full(6, _GROUND_SIGMA), axes, range(6)))
        if self.equipment is not None and (self.is_upright if ground is None else self.only_upright):
            row = index[self.equipment.root]
            up = poses[row, 2, :3]
            lean, sigmas = (hat(up) @ J[row, :3])[:2], np.full(2, self.equipment.upright_sigma)
            parts.append(_rows(self.equipment.root, up[:2], lean, sigmas, np.eye(3)[[1, 0]], range(2)))
        return Rows.stack(parts, self.tangent.count)

    def expectations(self, configuration: Configuration) -> tuple[Array, Array]:
        """Posture, limits and lengths: residuals in sigmas, and their Jacobian."""
        motion, joints, twists = configuration.joint_motion, self.tree.tree_joints, self.tangent.twists
        residuals, blocks = [], []

        def add(values: Array, columns: slice, by_columns: Array, sigma: Array | float) -> None:
            block = np.zeros((len(values), self.tangent.count))
            block[:, columns] = by_columns / np.reshape(sigma, (-1, 1))
            residuals.append(values / sigma)
            blocks.append(block)

        lean = log_so3(configuration.world_T_root[:3, :3])
        add(lean, slice(0, 3), turn_jacobian(lean), _LEAN_RAD)
        turned = log_so3(motion[:, :3, :3])
        by_turn = turn_jacobian(turned)
        angles = self.limits.nearest_angles(motion)
        excess, rates = self.limits.excess(angles), self.limits.angles.rates(angles)
        for row in self._posture:
            add(turned[row], self.tangent.columns[row], by_turn[row] @ twists[row][:3], _POSTURE_RAD)
        for angle in np.flatnonzero(excess):
            row = self.limits.angles.joint_rows[angle]
            add(excess[[angle]], self.tangent.columns[row], rates[[angle]] @ twists[row][:3], _LIMIT_RAD)
        for name, longer in self.longer_by(configuration).items():
            row, sigma = self.tree.joint_row[name], np.maximum(self.lengths[name], _KNOWN_M)
            parent_R_child = joints[row].parent_T_joint[:3, :3] @ motion[row, :3, :3]
            add(longer, self.tangent.columns[row], parent_R_child @ twists[row][3:], sigma)
        return np.concatenate(residuals), np.vstack(blocks)


def _sliding(joint: Joint) -> Joint:
    assert joint.sigmas is not None  # set when it was made
    return replace(joint, sigmas=(*joint.sigmas[:3], LOOSE_M, LOOSE_M, LOOSE_M))


def _rows(owner: str, gap: Array, jacobian: Array, sigmas: Array, axes: Array, chosen: Iterable[int]) -> Rows:
    rows = list(chosen)
    scaled = (gap / sigmas)[rows], (jacobian / sigmas[:, None])[rows]
    return Rows((owner,) * len(rows), axes[rows], np.array(rows) < 3, *scaled)
