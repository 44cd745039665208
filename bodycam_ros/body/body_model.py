"""The body: segments, the joints between them, and the cameras strapped to them.

Segments form a tree from the root; a joint whose child already hangs on another joint closes a loop (a foot on a
pedal). ``body_file`` reads and writes it.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.joint import Joint, check_within_reach
from bodycam_ros.camera.readout import Readout
from bodycam_ros.camera.video_mode import VideoMode
from bodycam_ros.errors import BodyError
from bodycam_ros.geometry import Array, inverse

THINNEST, THICKEST = 0.2, 5.0
"""Times as thick as people of a body's size are: beyond, a number was taken for something else."""


@dataclass(frozen=True, eq=False)
class CameraMount:
    """Where a camera is strapped to.

    Attributes:
        segment: the segment that carries it.
        segment_T_camera: (4, 4) pose of the camera's optical frame (x right, y down, z forward) [m].
        readout: how long its rows are read out, as far as the range of motion told.
        readout_mode: the video mode of that range of motion; None where the file does not name it.
    """

    segment: str
    segment_T_camera: Array
    readout: Readout | None = None
    readout_mode: VideoMode | None = None

    def readout_in(self, mode: VideoMode) -> Readout | None:
        """What the body file knows of the read-out time in a video mode; little if it was measured in another."""
        if self.readout is None or self.readout_mode is None or self.readout_mode.is_same(mode):
            return self.readout
        return self.readout.in_another_mode()


@dataclass(frozen=True, eq=False)
class BodyModel:
    """Segments, joints and camera mounts.

    Frames of segments (DESIGN 3): the origin is the joint to the parent, x forward, y left, z up in the N-pose.

    Attributes:
        name: of the body.
        root: the segment that hangs on no other.
        segments: (S) names; every (S, 4, 4) array of poses is in this order.
        joints: in the order of the file, tree and loops alike.
        mounts: camera -> where it is strapped to.
        report: figures of whoever made the body; kept, never used.
        standing: segments, of a machine, that do not move in the world; said to other programs, the solver has it from
            the equipment.
        surface: folder with the meshes of its segments, relative to the body file, for static cameras.
        girths: segment -> how many times as thick its capsules are as those of people of the body's size; 1 where
            nothing is said.

    Raises:
        BodyError: the parts do not make one body.
    """

    name: str
    root: str
    segments: tuple[str, ...]
    joints: tuple[Joint, ...]
    mounts: Mapping[str, CameraMount]
    report: Mapping[str, Any] = field(default_factory=dict)
    standing: tuple[str, ...] = ()
    surface: str | None = None
    girths: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        _check_unique("segment", self.segments)
        _check_unique("joint", [joint.name for joint in self.joints])
        if self.root not in self.segments:
            raise BodyError(f"root {self.root} is not among the segments {', '.join(self.segments)}")
        for joint in self.joints:
            for role, segment in (("parent", joint.parent), ("child", joint.child)):
                if segment not in self.segments:
                    raise BodyError(f"joint {joint.name}: {role} {segment} is not among the segments")
        for segment in self.standing:
            if segment not in self.segments:
                raise BodyError(f"{segment}, which is said to stand, is not among the segments")
        for segment, girth in self.girths.items():
            if segment not in self.segments:
                raise BodyError(f"girths: {segment} is not among the segments")
            if not THINNEST <= girth <= THICKEST:
                raise BodyError(
                    f"girths: {segment} is {girth:g} times as thick as people's; expected {THINNEST:g} to {THICKEST:g}"
                )
        for camera, mount in self.mounts.items():
            if mount.segment not in self.segments:
                raise BodyError(f"camera {camera}: segment {mount.segment} is not among the segments")
            if not np.isfinite(mount.segment_T_camera).all():
                raise BodyError(f"camera {camera}: its place on segment {mount.segment} is not finite")
            check_within_reach(f"camera {camera}", mount.segment_T_camera)
        self._check_one_tree()

    @cached_property
    def segment_index(self) -> dict[str, int]:
        """Segment -> its row in ``segments``."""
        return {segment: index for index, segment in enumerate(self.segments)}

    @cached_property
    def tree_joints(self) -> tuple[Joint, ...]:
        """(J) joints that hang each segment on its parent, parents first, else in the order of the file."""
        return tuple(self._tree_from_root())

    @cached_property
    def loop_joints(self) -> tuple[Joint, ...]:
        """Joints that close a loop; the solver obeys them, the URDF cannot show them."""
        return tuple(joint for joint in self.joints if joint not in self.tree_joints)

    @cached_property
    def equipment_segments(self) -> frozenset[str]:
        """Segments that are no part of the body: those on a free joint, beside it, and all that hang on these."""
        beside: set[str] = set()
        for joint in self.tree_joints:
            if joint.type == "free" or joint.parent in beside:
                beside.add(joint.child)
        return frozenset(beside)

    @cached_property
    def joint_ends(self) -> NDArray[Any]:
        """(J, 2) rows of the parents and children of ``tree_joints``."""
        row = self.segment_index
        return np.array([(row[joint.parent], row[joint.child]) for joint in self.tree_joints], np.int64).reshape(-1, 2)

    @cached_property
    def rows_below(self) -> dict[int, list[int]]:
        """Row of each segment that hangs on another -> rows of it and of all that hang on it."""
        row = self.segment_index
        hanging = [joint for joint in self.tree_joints if joint.type != "free"]
        below = {row[joint.child]: [row[joint.child]] for joint in hanging}
        for joint in reversed(hanging):
            if row[joint.parent] in below:
                below[row[joint.parent]] += below[row[joint.child]]
        return below

    def joint_to_parent(self, segment: str) -> Joint | None:
        """The joint that hangs a segment on its parent; None for the root."""
        return next((joint for joint in self.tree_joints if joint.child == segment), None)

    def named(self, segments: Iterable[str]) -> NDArray[np.bool_]:
        """Which segments (S,) are named."""
        rows = np.zeros(len(self.segments), bool)
        rows[[self.segment_index[segment] for segment in segments]] = True
        return rows

    def cameras_on(self, segment: str) -> tuple[str, ...]:
        """Names of the cameras on a segment."""
        return tuple(camera for camera, mount in self.mounts.items() if mount.segment == segment)

    def forward_kinematics(self, world_T_root: Array, joint_motion: Array) -> Array:
        """Poses world_T_segment (..., S, 4, 4) of all segments, in the order of ``segments`` (A eq. 3-4).

        Args:
            world_T_root: (..., 4, 4) pose of the root segment [m].
            joint_motion: (..., J, 3, 3) parent_joint_R_child_joint, in the order of ``tree_joints``, or (..., J, 4, 4)
                with places; without, the children of free joints sit where the joint is on the parent.
        """
        world_T_segment = np.empty((*joint_motion.shape[:-3], len(self.segments), 4, 4))
        world_T_segment[..., self.segment_index[self.root], :, :] = world_T_root
        size = joint_motion.shape[-1]
        turn = np.zeros((*joint_motion.shape[:-3], 4, 4))
        turn[..., 3, 3] = 1.0
        for index, joint in enumerate(self.tree_joints):
            turn[..., :size, :size] = joint_motion[..., index, :, :]
            world_T_parent = world_T_segment[..., self.segment_index[joint.parent], :, :]
            world_T_child = world_T_parent @ joint.parent_T_joint @ turn @ joint.joint_T_child
            world_T_segment[..., self.segment_index[joint.child], :, :] = world_T_child
        return world_T_segment

    def joint_rotations(self, world_T_segment: Array) -> Array:
        """Joint rotations (..., J, 3, 3), in the order of ``tree_joints``, of poses (..., S, 4, 4).

        What the joint's type forbids is dropped, so ``forward_kinematics`` closes every gap of the tree.
        """
        parents, children, joint_R_parent, child_R_joint, restricted = self._tree_arrays
        world_R_segment = world_T_segment[..., :3, :3]
        parent_R_child = np.swapaxes(world_R_segment[..., parents, :, :], -1, -2) @ world_R_segment[..., children, :, :]
        rotations: Array = joint_R_parent @ parent_R_child @ child_R_joint
        for row, joint in restricted:
            rotations[..., row, :, :] = joint.permitted_rotation(rotations[..., row, :, :])
        return rotations

    def joint_poses(self, world_T_segment: Array) -> Array:
        """``joint_rotations`` as poses (..., J, 4, 4), with the places of free joints' children in their parents."""
        rotations = self.joint_rotations(world_T_segment)
        poses = np.zeros((*rotations.shape[:-2], 4, 4))
        poses[..., :3, :3], poses[..., 3, 3] = rotations, 1.0
        for row, joint in enumerate(self.tree_joints):
            if joint.type == "free":
                parent, child = (self.segment_index[segment] for segment in (joint.parent, joint.child))
                world_T_joint = world_T_segment[..., parent, :, :] @ joint.parent_T_joint
                world_T_end = world_T_segment[..., child, :, :] @ joint.child_T_joint
                poses[..., row, :3, 3] = (inverse(world_T_joint) @ world_T_end)[..., :3, 3]
        return poses

    @cached_property
    def _tree_arrays(self) -> tuple[list[int], list[int], Array, Array, list[tuple[int, Joint]]]:
        """Rows of parents and children, the joints' frames on both (J, 3, 3), and which joints forbid a rotation."""
        joints = self.tree_joints
        return (
            [self.segment_index[joint.parent] for joint in joints],
            [self.segment_index[joint.child] for joint in joints],
            np.array([joint.parent_T_joint[:3, :3].T for joint in joints]).reshape(-1, 3, 3),
            np.array([joint.child_T_joint[:3, :3] for joint in joints]).reshape(-1, 3, 3),
            [(row, joint) for row, joint in enumerate(joints) if joint.type != "ball"],
        )

    def _tree_from_root(self) -> list[Joint]:
        """Of the joints to one child the first in the file carries it, the others close loops."""
        carrier: dict[str, Joint] = {}
        for joint in self.joints:
            if joint.child != self.root:
                carrier.setdefault(joint.child, joint)
        reached, tree = {self.root}, []
        pending = list(carrier.values())
        while ready := [joint for joint in pending if joint.parent in reached]:
            joint = ready[0]
            pending.remove(joint)
            reached.add(joint.child)
            tree.append(joint)
        return tree

    def _check_one_tree(self) -> None:
        hung = {self.root, *(joint.child for joint in self.tree_joints)}
        loose = [segment for segment in self.segments if segment not in hung]
        if loose:
            raise BodyError(
                f"segments {', '.join(loose)} do not hang on root {self.root}: a body has one root; each other segment "
                "must be the child of a joint from a segment nearer to the root"
            )


def _check_unique(what: str, names: tuple[str, ...] | list[str]) -> None:
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise BodyError(f"{what} {', '.join(twice)} is listed twice; names must differ")
