"""A body and its equipment as a mechanism: the freedoms of its tree, and the rows that close its loops (B 3.2)."""

from collections.abc import Collection
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.equipment.coupled_body import coupled_body
from bodycam_ros.equipment.equipment import Equipment
from bodycam_ros.equipment.fitted_equipment import fitted_equipment
from bodycam_ros.geometry import Array, adjoint, exp_se3, hat, inverse, log_se3, rigid
from bodycam_ros.kinematics.joint import Joint
from bodycam_ros.kinematics.joint_gap import GIVES_M, GIVES_RAD, gap_jacobians, held_rows, joint_gap

STIFF = 1e-4  # [rad] and [m] sigma of what stands still


@dataclass(frozen=True)
class Freedom:
    """Columns that belong together.

    Attributes:
        name: of the root segment, of the joint, or of what has an unknown place.
        kind: "place" of a segment that hangs on nothing, "joint", or "length" of the equipment.
        columns: where they stand among all.
    """

    name: str
    kind: str
    columns: slice


@dataclass(frozen=True, eq=False)
class Configuration:
    """Where everything is.

    Attributes:
        world_T_root: (4, 4).
        joint_motion: (J, 4, 4) of the tree's joints; the place in it is that of free and sliding joints, and what an
            unknown length is longer than said.
        shifts: attachment -> (3) by how much its points on the equipment are elsewhere than said [m].
    """

    world_T_root: Array
    joint_motion: Array
    shifts: dict[str, Array]


@dataclass(frozen=True, eq=False)
class Rows:
    """Constraint rows in units of sigma.

    Attributes:
        owners: (R) the joint, or what stands, that each row is of.
        kinds: (R) index 0 to 5 of each among its owner's: rotations, then places.
        residuals: (R).
        jacobian: (R, K).
    """

    owners: tuple[str, ...]
    kinds: tuple[int, ...]
    residuals: Array
    jacobian: Array


class Mechanism:
    """The columns and rows of a body, with equipment or alone.

    Attributes:
        body: both as one (``coupled_body``).
        equipment: as far as the body can hold it, or None.
        freedoms: all groups of columns, the root's place first, lengths last.

    Raises:
        BodyError: the equipment does not fit the body.
    """

    def __init__(self, body: BodyModel, equipment: Equipment | None = None) -> None:
        equipment = None if equipment is None else fitted_equipment(equipment, body)
        self.equipment = equipment
        self.body = body if equipment is None else coupled_body(body, equipment)
        self.tangents_of_joints = [free_tangents(joint) for joint in self.body.tree_joints]
        lengths = {} if equipment is None else dict(equipment.unknown)
        attachments = () if equipment is None else equipment.attachments
        lengths |= {attachment.name: attachment.unknown for attachment in attachments}
        self.length_sigmas = {name: np.asarray(sigma) for name, sigma in lengths.items() if np.any(sigma)}
        groups = [(self.body.root, "place", 6)]
        for joint, tangents in zip(self.body.tree_joints, self.tangents_of_joints, strict=True):
            groups.append((joint.name, "place" if joint.type == "free" else "joint", tangents.shape[1]))
        groups += [(name, "length", 3) for name in self.length_sigmas]
        freedoms, start = [], 0
        for name, kind, count in groups:
            freedoms.append(Freedom(name, kind, slice(start, start + count)))
            start += count
        self.freedoms, self.column_count = tuple(freedoms), start
        self.loops = self.body.loop_joints

    @cached_property
    def loops_through(self) -> dict[str, tuple[str, ...]]:
        """Joint of the tree -> the loops that it is in."""
        above = {joint.child: joint for joint in self.body.tree_joints}

        def chain(segment: str) -> set[str]:
            names = set()
            while joint := above.get(segment):
                names.add(joint.name)
                segment = joint.parent
            return names

        within = {loop.name: chain(loop.parent) ^ chain(loop.child) for loop in self.loops}
        return {
            joint.name: tuple(loop for loop, joints in within.items() if joint.name in joints)
            for joint in self.body.tree_joints
        }

    @cached_property
    def stands(self) -> tuple[str, ...]:
        """Segments of the equipment that do not move in the world."""
        segments = {} if self.equipment is None else self.equipment.segments
        return tuple(name for name, motion in segments.items() if motion.stands)

    @cached_property
    def is_upright(self) -> bool:
        """Whether the equipment's root may not lean."""
        return self.equipment is not None and self.equipment.upright_sigma < GIVES_RAD

    @cached_property
    def only_upright(self) -> bool:
        """Whether the equipment's root may not lean and does not stand still either."""
        return self.is_upright and self.equipment is not None and self.equipment.root not in self.stands

    @cached_property
    def column_units(self) -> Array:
        """(K) 1 for a rotation, a limb's length [m] for a place: by these, columns are alike."""
        units = np.ones(self.column_count)
        for freedom, tangents in zip(self.freedoms, [np.eye(6), *self.tangents_of_joints], strict=False):
            units[freedom.columns] = np.where(np.abs(tangents[3:]).any(axis=0), 0.4, 1.0)
        units[self.columns("length")] = 0.4
        return units

    def columns(self, *kinds: str, names: Collection[str] | None = None) -> NDArray[np.int_]:
        """Indices of the columns of some kinds, and of some names."""
        chosen = [f for f in self.freedoms if f.kind in kinds and (names is None or f.name in names)]
        return np.concatenate([np.zeros(0, int), *(np.arange(f.columns.start, f.columns.stop) for f in chosen)])

    def resting(self) -> Configuration:
        """The N-pose, the equipment's root where the body's is."""
        motion = np.tile(np.eye(4), (len(self.body.tree_joints), 1, 1))
        attachments = [name for name in self.length_sigmas if name in {joint.name for joint in self.loops}]
        return Configuration(np.eye(4), motion, {name: np.zeros(3) for name in attachments})

    def moved(self, configuration: Configuration, step: Array) -> Configuration:
        """After a step (K): tangents of root, joints and free segments, and lengths along the parent's axes [m]."""
        motion = configuration.joint_motion.copy()
        row_of = {joint.name: row for row, joint in enumerate(self.body.tree_joints)}
        shifts = dict(configuration.shifts)
        for freedom in self.freedoms[1:]:
            part = step[freedom.columns]
            if freedom.kind != "length":
                row = row_of[freedom.name]
                motion[row] = motion[row] @ exp_se3(self.tangents_of_joints[row] @ part)
            elif freedom.name in shifts:
                shifts[freedom.name] = shifts[freedom.name] + part
            else:
                row = row_of[freedom.name]
                motion[row, :3, 3] += self.body.tree_joints[row].parent_T_joint[:3, :3].T @ part
        root = configuration.world_T_root @ exp_se3(step[self.freedoms[0].columns])
        return Configuration(root, motion, shifts)

    def longer_by(self, configuration: Configuration, name: str) -> Array:
        """(3) by how much an unknown length is more than said, along the axes of the equipment's segment [m]."""
        if name in configuration.shifts:
            return configuration.shifts[name]
        row, joint = next((row, joint) for row, joint in enumerate(self.body.tree_joints) if joint.name == name)
        longer: Array = joint.parent_T_joint[:3, :3] @ configuration.joint_motion[row, :3, 3]
        return longer

    def poses(self, configuration: Configuration) -> Array:
        """world_T_segment (S, 4, 4)."""
        return self.body.forward_kinematics(configuration.world_T_root, configuration.joint_motion)

    def segment_jacobians(self, configuration: Configuration) -> Array:
        """(S, 6, K) how each segment's pose moves, a tangent in its own axes."""
        body, index = self.body, self.body.segment_index
        J = np.zeros((len(body.segments), 6, self.column_count))
        J[index[body.root], :, :6] = np.eye(6)
        lengths = {freedom.name: freedom.columns for freedom in self.freedoms if freedom.kind == "length"}
        for row, (joint, freedom) in enumerate(zip(body.tree_joints, self.freedoms[1:], strict=False)):
            motion = configuration.joint_motion[row]
            child_T_parent = inverse(joint.parent_T_joint @ motion @ joint.joint_T_child)
            J_child = adjoint(child_T_parent) @ J[index[joint.parent]]
            J_child[:, freedom.columns] += adjoint(joint.child_T_joint) @ self.tangents_of_joints[row]
            if joint.name in lengths:
                J_child[:, lengths[joint.name]] += adjoint(child_T_parent)[:, 3:]
            J[index[joint.child]] = J_child
        return J

    def loop(self, joint: Joint, configuration: Configuration) -> Joint:
        """A joint that closes a loop, where the unknown place of the equipment's points puts it."""
        shift = configuration.shifts.get(joint.name)
        return joint if shift is None else replace(joint, parent_T_joint=rigid(np.eye(3), shift) @ joint.parent_T_joint)

    def loop_rows(self, configuration: Configuration) -> Rows:
        """Rows of all joints that close loops."""
        poses, J = self.poses(configuration), self.segment_jacobians(configuration)
        index = self.body.segment_index
        parts = []
        for joint in self.loops:
            placed = self.loop(joint, configuration)
            parent, child = index[joint.parent], index[joint.child]
            gap = joint_gap(placed, poses[parent], poses[child])
            by_parent, by_child = gap_jacobians(placed, poses[parent], poses[child])
            jacobian = by_parent @ J[parent] + by_child @ J[child]
            if joint.name in configuration.shifts:
                jacobian[:, self.columns("length", names=[joint.name])] += by_parent[:, 3:]
            assert joint.sigmas is not None  # set when it was made
            parts.append(_rows(joint.name, held_rows(joint), gap, jacobian, np.array(joint.sigmas)))
        return stacked(parts, self.column_count)

    def standing_rows(self, configuration: Configuration, standing: Array) -> Rows:
        """Rows of the segments that stand in the world at poses (S, 4, 4)."""
        poses, J = self.poses(configuration), self.segment_jacobians(configuration)
        parts = []
        for segment in self.stands:
            row = self.body.segment_index[segment]
            away = log_se3(inverse(standing[row]) @ poses[row])
            parts.append(_rows(segment, range(6), away, J[row], np.full(6, STIFF)))
        return stacked(parts, self.column_count)

    def upright_rows(self, configuration: Configuration) -> Rows:
        """Two rows if the equipment's root may not lean, else none."""
        if not self.is_upright or self.equipment is None:
            return stacked([], self.column_count)
        row = self.body.segment_index[self.equipment.root]
        world_R_root = self.poses(configuration)[row, :3, :3]
        up, turns = world_R_root[2], self.segment_jacobians(configuration)[row, :3]
        sigmas = np.full(2, self.equipment.upright_sigma)
        return _rows(self.equipment.root, (0, 1), up[:2], (hat(up) @ turns)[:2], sigmas)


def free_tangents(joint: Joint) -> Array:
    """(6, F) tangents of a tree joint's motion that it leaves free."""
    if joint.type == "free":
        return np.eye(6)
    assert joint.sigmas is not None
    turns = {"ball": np.eye(3), "hinge": joint.axis[:, None], "weld": np.zeros((3, 0))}[joint.type]
    slides = np.eye(3)[:, [axis for axis in range(3) if joint.sigmas[3 + axis] >= GIVES_M]]
    tangents = np.zeros((6, turns.shape[1] + slides.shape[1]))
    tangents[:3, : turns.shape[1]], tangents[3:, turns.shape[1] :] = turns, slides
    return tangents


def stacked(parts: list[Rows], columns: int) -> Rows:
    """Several rows of so many columns as one."""
    parts = [*parts, Rows((), (), np.zeros(0), np.zeros((0, columns)))]
    return Rows(
        tuple(owner for part in parts for owner in part.owners),
        tuple(kind for part in parts for kind in part.kinds),
        np.concatenate([part.residuals for part in parts]),
        np.vstack([part.jacobian for part in parts]),
    )


def _rows(owner: str, held: Collection[int], gap: Array, jacobian: Array, sigmas: Array) -> Rows:
    chosen = list(held)
    scale = 1.0 / sigmas[chosen]
    return Rows((owner,) * len(chosen), tuple(chosen), scale * gap[chosen], scale[:, None] * jacobian[chosen])
