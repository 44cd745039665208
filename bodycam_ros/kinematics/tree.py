"""A tree of segments with joints, and further joints that close loops: its poses from coordinates, and back.

The coordinates are the pose of the root and, for each joint of the tree, its *joint motion*, the pose of the joint's
frame on the child in its frame on the parent: a rotation for a ball, one about the axis for a hinge, the identity for a
weld, anything for a free joint. ``JointAngles`` has the same as one vector of angles. The pose of a segment is

    world_T_segment = world_T_root prod (parent_T_joint exp(theta_j xi_j) joint_T_child)

over the joints from the root to it: the product of exponentials of B eq. 3, its twists xi_j in the joints' own frames
instead of the world's.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.errors import BodyError
from bodycam_ros.files.shown import other_than
from bodycam_ros.geometry import Array, inverse, rigid
from bodycam_ros.kinematics.joint import Joint
from bodycam_ros.kinematics.tree_kernels import tree_poses


@dataclass(frozen=True, eq=False)
class KinematicTree:
    """Segments and joints.

    Frames of segments (docs/joints.md): the origin is the joint to the parent, x forward, y left, z up in the N-pose.

    Attributes:
        name: of the body or machine.
        root: the segment that hangs on no other.
        segments: (S) names; every (S, 4, 4) array of poses is in this order.
        joints: in any order. The first joint to a child belongs to the tree, others to it close loops.

    Raises:
        BodyError: the parts do not make one tree.
    """

    name: str
    root: str
    segments: tuple[str, ...]
    joints: tuple[Joint, ...]

    def __post_init__(self) -> None:
        _check_unique("segment", self.segments)
        _check_unique("joint", tuple(joint.name for joint in self.joints))
        if self.root not in self.segments:
            raise BodyError(f"root {self.root} is not among the segments {', '.join(self.segments)}")
        for joint in self.joints:
            for role, segment in (("parent", joint.parent), ("child", joint.child)):
                if segment not in self.segments:
                    raise BodyError(
                        f"joint {joint.name}: {role} {segment} is not among the segments; "
                        f"{other_than(segment, self.segments)}"
                    )
        hung = {self.root, *(joint.child for joint in self.tree_joints)}
        loose = [segment for segment in self.segments if segment not in hung]
        if loose:
            raise BodyError(
                f"segments {', '.join(loose)} do not hang on root {self.root}: a body has one root; each other segment "
                "must be the child of a joint from a segment nearer to the root"
            )

    @cached_property
    def segment_index(self) -> dict[str, int]:
        """Segment -> its row in ``segments``."""
        return {segment: index for index, segment in enumerate(self.segments)}

    @cached_property
    def tree_joints(self) -> tuple[Joint, ...]:
        """(J) joints that hang each segment on its parent, parents first, else in the order of ``joints``."""
        carrier: dict[str, Joint] = {}
        for joint in self.joints:
            if joint.child != self.root:
                carrier.setdefault(joint.child, joint)
        reached = {self.root}
        tree = []
        pending = list(carrier.values())
        while ready := [joint for joint in pending if joint.parent in reached]:
            pending.remove(ready[0])
            reached.add(ready[0].child)
            tree.append(ready[0])
        return tuple(tree)

    @cached_property
    def loop_joints(self) -> tuple[Joint, ...]:
        """Joints that close a loop; the solver obeys them, the URDF cannot show them."""
        return tuple(joint for joint in self.joints if joint not in self.tree_joints)

    @cached_property
    def joint_row(self) -> dict[str, int]:
        """Joint of the tree -> its row in ``tree_joints``."""
        return {joint.name: row for row, joint in enumerate(self.tree_joints)}

    @cached_property
    def joint_ends(self) -> NDArray[Any]:
        """(J, 2) rows of the parents and children of ``tree_joints``."""
        row = self.segment_index
        return np.array([(row[joint.parent], row[joint.child]) for joint in self.tree_joints], np.int64).reshape(-1, 2)

    @cached_property
    def moves(self) -> NDArray[np.bool_]:
        """(S, J) whether a joint of the tree is between the root and a segment: its motion moves the segment.

        The set of joints that affect a point, in B eq. 7.
        """
        moves = np.zeros((len(self.segments), len(self.tree_joints)), bool)
        for row, (parent, child) in enumerate(self.joint_ends):
            moves[child] = moves[parent]
            moves[child, row] = True
        return moves

    @cached_property
    def equipment_segments(self) -> frozenset[str]:
        """Segments that are no part of the body: those on a free joint, beside it, and all that hang on these."""
        free = [row for row, joint in enumerate(self.tree_joints) if joint.type == "free"]
        return frozenset(self.segments[row] for row in np.flatnonzero(self.moves[:, free].any(axis=1)))

    @cached_property
    def rows_below(self) -> dict[int, list[int]]:
        """Row of each segment that hangs on another -> rows of it and of all that hang on it, free joints apart."""
        beside = self.named(self.equipment_segments)
        return {
            child: np.flatnonzero(self.moves[:, row] & (beside == beside[child])).tolist()
            for row, child in enumerate(self.joint_ends[:, 1].tolist())
            if self.tree_joints[row].type != "free"
        }

    def joint_to_parent(self, segment: str) -> Joint | None:
        """The joint that hangs a segment on its parent; None for the root."""
        return next((joint for joint in self.tree_joints if joint.child == segment), None)

    def named(self, segments: Iterable[str]) -> NDArray[np.bool_]:
        """Which segments (S,) are named."""
        rows = np.zeros(len(self.segments), bool)
        rows[[self.segment_index[segment] for segment in segments]] = True
        return rows

    def forward_kinematics(self, world_T_root: Array, joint_motion: Array) -> Array:
        """Poses world_T_segment (..., S, 4, 4) of all segments, in the order of ``segments`` (A eq. 3-4, B eq. 3).

        Args:
            world_T_root: (..., 4, 4) pose of the root segment [m].
            joint_motion: (..., J, 3, 3) parent_joint_R_child_joint, in the order of ``tree_joints``, or (..., J, 4, 4)
                with translations; without, the children of free joints sit where the joint is on the parent.
        """
        if joint_motion.shape[-1] == 3:
            joint_motion = rigid(joint_motion, np.zeros(3))
        return self.poses_of(all_motion(world_T_root, joint_motion))

    def poses_of(self, motion: Array) -> Array:
        """The same of motions (..., 1 + J, 4, 4) of the root and of all joints (``all_motion``)."""
        _, _, parent_T_joint, joint_T_child = self._frames
        rows, root = motion.reshape(-1, *motion.shape[-3:]), self.segment_index[self.root]
        poses: Array = tree_poses(rows, parent_T_joint, joint_T_child, self.joint_ends, root)
        return poses.reshape(motion.shape)

    def n_pose(self, world_T_root: Array) -> Array:
        """Poses world_T_segment (S, 4, 4) of the body standing with its arms down: all joint motions the identity."""
        return self.forward_kinematics(world_T_root, np.tile(np.eye(3), (len(self.tree_joints), 1, 1)))

    def joint_rotations(self, world_T_segment: Array) -> Array:
        """Joint rotations (..., J, 3, 3), in the order of ``tree_joints``, of poses (..., S, 4, 4).

        What the joint's type forbids is dropped, so ``forward_kinematics`` closes every gap of the tree.
        """
        joint_R_parent, child_R_joint, _, _ = self._frames
        parents, children = self.joint_ends.T
        world_R_segment = world_T_segment[..., :3, :3]
        parent_R_child = np.swapaxes(world_R_segment[..., parents, :, :], -1, -2) @ world_R_segment[..., children, :, :]
        rotations: Array = joint_R_parent @ parent_R_child @ child_R_joint
        for row, joint in self._restricted:
            rotations[..., row, :, :] = joint.permitted_rotation(rotations[..., row, :, :])
        return rotations

    def joint_poses(self, world_T_segment: Array, slides: NDArray[np.bool_] | None = None) -> Array:
        """Joint motions (..., J, 4, 4) of poses (..., S, 4, 4): ``joint_rotations`` with what slides.

        Args:
            world_T_segment: poses.
            slides: (J, 3) along which of its axes a joint may slide; None: free joints along all, others along none.
        """
        motion = rigid(self.joint_rotations(world_T_segment), np.zeros(3))
        slides = self._slides_of_free if slides is None else slides
        for row in np.flatnonzero(slides.any(axis=1)):
            joint, (parent, child) = self.tree_joints[row], self.joint_ends[row]
            world_T_joint = world_T_segment[..., parent, :, :] @ joint.parent_T_joint
            world_T_end = world_T_segment[..., child, :, :] @ joint.child_T_joint
            motion[..., row, :3, 3] = slides[row] * (inverse(world_T_joint) @ world_T_end)[..., :3, 3]
        return motion

    def motion_of(self, world_T_segment: Array, slides: NDArray[np.bool_] | None = None) -> Array:
        """Motions (..., 1 + J, 4, 4) of root and joints, see ``joint_poses``; the inverse of ``poses_of``."""
        root = world_T_segment[..., self.segment_index[self.root], :, :]
        return all_motion(root, self.joint_poses(world_T_segment, slides))

    @cached_property
    def _frames(self) -> tuple[Array, Array, Array, Array]:
        """joint_R_parent and child_R_joint (J, 3, 3), parent_T_joint and joint_T_child (J, 4, 4)."""
        joints = self.tree_joints
        parent_T_joint = np.array([joint.parent_T_joint for joint in joints]).reshape(-1, 4, 4)
        joint_T_child = np.array([joint.joint_T_child for joint in joints]).reshape(-1, 4, 4)
        child_R_joint = np.array([joint.child_T_joint[:3, :3] for joint in joints]).reshape(-1, 3, 3)
        return np.swapaxes(parent_T_joint[:, :3, :3], 1, 2), child_R_joint, parent_T_joint, joint_T_child

    @cached_property
    def _slides_of_free(self) -> NDArray[np.bool_]:
        return np.array([[joint.type == "free"] * 3 for joint in self.tree_joints], bool).reshape(-1, 3)

    @cached_property
    def _restricted(self) -> list[tuple[int, Joint]]:
        return [(row, joint) for row, joint in enumerate(self.tree_joints) if joint.type in ("hinge", "weld")]


def all_motion(world_T_root: Array, joint_motion: Array) -> Array:
    """Motions (..., 1 + J, 4, 4) of the root (..., 4, 4) and of joints (..., J, 4, 4), row by row in memory."""
    motion = np.empty((*joint_motion.shape[:-3], joint_motion.shape[-3] + 1, 4, 4))
    motion[..., 0, :, :], motion[..., 1:, :, :] = world_T_root, joint_motion
    return motion


def _check_unique(what: str, names: tuple[str, ...]) -> None:
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise BodyError(f"{what} {', '.join(twice)} is listed twice; names must differ")
