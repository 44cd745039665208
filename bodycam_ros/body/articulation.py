"""The articulated body as one vector of unknowns: what stays the same over a recording, and what moves (A eq. 3-5).

Every segment has its own rotation at every instant; its position follows from the root's through the joints, so no
joint ever gapes.

The instants of an articulated motion depend on each other through what lasts alone: the body, its mounts, the clocks of
its cameras. Each is eliminated on its own by a Schur complement.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.geometry import (
    exp_se3,
    exp_so3,
    hat,
    inverse,
    log_so3,
    nearest_rotation,
    rigid,
    robust_average_pose,
)
from bodycam_ros.kinematics.joint import Joint

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ArticulatedMotion:
    """A body and its motion, all as arrays.

    Attributes:
        body: names and tree; the geometry is in the arrays.
        cameras: (C) names of the mounts' order.
        offsets: (S, 3) where a segment's joint sits in its parent [m]; zero for the root.
        mounts: (C, 4, 4) segment_T_camera.
        root_positions: (T, 3) in the world [m].
        rotations: (T, S, 3, 3) world_R_segment.
        delays: (C) by how much the clock of each camera is ahead of the body's [s].
        twists: (T, C, 6) of the cameras, in their own axes [rad/s, m/s].
        triggered: (C) whether a camera's stamps are those of the others.
    """

    body: BodyModel
    cameras: tuple[str, ...]
    offsets: Array
    mounts: Array
    root_positions: Array
    rotations: Array
    delays: Array
    twists: Array
    triggered: NDArray[np.bool_]

    @cached_property
    def parent_rows(self) -> tuple[int, ...]:
        """(S) row of each segment's parent; -1 for the root."""
        parent_of = {child: parent for parent, child in self.body.joint_ends.tolist()}
        return tuple(parent_of.get(row, -1) for row in range(len(self.body.segments)))

    @cached_property
    def carriers(self) -> tuple[int, ...]:
        """(C) row of the segment that carries each camera."""
        return tuple(self.body.segment_index[self.body.mounts[camera].segment] for camera in self.cameras)

    @property
    def moving_count(self) -> int:
        """Unknowns of one instant: the root's position, then each segment's rotation."""
        return 3 + 3 * len(self.body.segments)

    @property
    def lasting_count(self) -> int:
        """Unknowns of the body: each segment's offset (the root's is held), each camera's mount and delay."""
        return 3 * len(self.body.segments) + 7 * len(self.cameras)

    def offset_columns(self, segment_row: int) -> slice:
        """Where a segment's offset stands among the lasting unknowns."""
        return slice(3 * segment_row, 3 * segment_row + 3)

    def mount_columns(self, camera_row: int) -> slice:
        """Where a camera's mount stands among the lasting unknowns: rotation, then translation in camera axes."""
        start = 3 * len(self.body.segments) + 6 * camera_row
        return slice(start, start + 6)

    @property
    def delay_columns(self) -> slice:
        """Where the delays stand among the lasting unknowns."""
        return slice(self.lasting_count - len(self.cameras), self.lasting_count)

    def world_T_segment(self) -> Array:
        """Poses (T, S, 4, 4) (A eq. 3-4)."""
        positions = np.empty((*self.rotations.shape[:2], 3))
        positions[:, self.body.segment_index[self.body.root]] = self.root_positions
        for parent, child in self.body.joint_ends.tolist():
            positions[:, child] = positions[:, parent] + self.rotations[:, parent] @ self.offsets[child]
        return rigid(self.rotations, positions)

    def world_T_camera(self) -> Array:
        """Poses (T, C, 4, 4) at what the cameras' clocks call the instants (A eq. 5): earlier by their delays."""
        poses: Array = self.world_T_segment()[:, list(self.carriers)] @ self.mounts
        return poses @ exp_se3(-self.delays[:, None] * self.twists) if self.delays.any() else poses

    def jacobians(self) -> tuple[Array, Array]:
        """How each camera's pose moves, a tangent in its own axes, with the unknowns of its instant and of the body.

        Returns:
            (T, C, 6, moving_count) and (T, C, 6, lasting_count); see ``moved`` for the unknowns' meaning.
        """
        lasting = np.zeros((len(self.rotations), len(self.cameras), 6, self.lasting_count))
        for c in range(len(self.cameras)):
            lasting[:, c, :, self.mount_columns(c)] = np.eye(6)
        lasting[..., self.delay_columns] = self.delay_jacobians()
        return self.moving_jacobians(lasting), lasting

    def delay_jacobians(self) -> Array:
        """(T, C, 6, C) how the cameras' poses move with their delays."""
        each = np.arange(len(self.cameras))
        of_delays = np.zeros((len(self.rotations), len(self.cameras), 6, len(self.cameras)))
        of_delays[:, each, :, each] = -np.swapaxes(self.twists, 0, 1)
        return of_delays

    def moving_jacobians(self, lasting: Array | None = None) -> Array:
        """(T, C, 6, moving_count) how the cameras' poses move with the unknowns of their instant.

        The columns of the offsets are written into ``lasting`` on the way.
        """
        moving = np.zeros((len(self.rotations), len(self.cameras), 6, self.moving_count))
        for c, carrier in enumerate(self.carriers):
            R_mount, m = self.mounts[c, :3, :3], self.mounts[c, :3, 3]
            camera_R_world = np.swapaxes(self.rotations[:, carrier] @ R_mount, -1, -2)
            moving[:, c, 3:, :3] = camera_R_world
            moving[:, c, :3, _turn(carrier)] = R_mount.T
            moving[:, c, 3:, _turn(carrier)] = -R_mount.T @ hat(m)
            row = carrier
            while (parent := self.parent_rows[row]) >= 0:
                camera_R_parent = camera_R_world @ self.rotations[:, parent]
                moving[:, c, 3:, _turn(parent)] += -camera_R_parent @ hat(self.offsets[row])
                if lasting is not None:
                    lasting[:, c, 3:, self.offset_columns(row)] = camera_R_parent
                row = parent
        return moving

    def moved(self, moving: Array, lasting: Array) -> "ArticulatedMotion":
        """The motion after a step.

        Args:
            moving: (T, moving_count) the root's shift in the world [m], then a rotation vector per segment in its own
                axes [rad].
            lasting: (lasting_count) shift of each offset in the parent's axes [m], then a tangent per mount in the
                camera's axes, then what each camera's delay grows by [s].
        """
        segments, cameras = len(self.body.segments), len(self.cameras)
        turns = moving[:, 3:].reshape(-1, segments, 3)
        return replace(
            self,
            offsets=self.offsets + lasting[: 3 * segments].reshape(segments, 3),
            mounts=_orthonormal(self.mounts @ exp_se3(lasting[3 * segments : -cameras].reshape(cameras, 6))),
            delays=self.delays + lasting[-cameras:],
            root_positions=self.root_positions + moving[:, :3],
            rotations=nearest_rotation(self.rotations @ exp_so3(turns)),
        )

    def with_segment_axes(self, old_R_new: Array) -> "ArticulatedMotion":
        """The same motion with other axes (S, 3, 3) on the segments, about the same origins."""
        new_R_old = np.swapaxes(old_R_new, -1, -2)
        parents = [max(parent, 0) for parent in self.parent_rows]
        new_T_old = rigid(new_R_old, np.zeros(3))
        return replace(
            self,
            offsets=(new_R_old[parents] @ self.offsets[..., None])[..., 0],
            mounts=new_T_old[list(self.carriers)] @ self.mounts,
            rotations=self.rotations @ old_R_new,
        )

    def with_zero_at(self, resting: NDArray[np.bool_], world_R_rest: Array) -> "ArticulatedMotion":
        """The same motion, with all segments' axes those of the N-pose (3, 3) on average over some instants (T)."""
        old_R_new = [
            robust_average_pose(rigid(self.rotations[resting, row], np.zeros(3)))[:3, :3].T @ world_R_rest
            for row in range(len(self.body.segments))
        ]
        return self.with_segment_axes(np.stack(old_R_new))

    def with_body(self, body: BodyModel) -> "ArticulatedMotion":
        """The same motion of the cameras on a body whose joints or root's origin sit elsewhere on its segments."""
        root = self.body.segment_index[self.body.root]
        camera = self.carriers.index(root)
        mount = body.mounts[self.cameras[camera]].segment_T_camera
        old_T_new = self.mounts[camera] @ inverse(mount)
        root_positions = self.root_positions + self.rotations[:, root] @ old_T_new[:3, 3]
        return replace(
            articulated(body, self.cameras, root_positions, self.rotations, self.twists, self.triggered),
            delays=self.delays,
        )

    def joints_at_zero(self, joints: Iterable[Joint]) -> dict[str, Array]:
        """Joint -> (3,) where it is when all segments have the root's axes, in those of the root [m]."""
        body = self.body_with_geometry()
        world_T_segment = body.n_pose(np.eye(4))
        return {joint.name: world_T_segment[body.segment_index[joint.child], :3, 3] for joint in joints}

    def hinge_axis(self, child: str) -> Array:
        """(3,) direction on a segment that its joint never turned across, to the left rather than to the right."""
        R = self._joint_rotations(child)
        axis: Array = np.linalg.svd((R - R.mean(axis=0)).reshape(-1, 3), full_matrices=False)[2][2]
        return axis if axis[1] >= 0 else -axis

    def exercised(self, child: str) -> Array:
        """(3,) extents of a joint's rotation about its principal axes [rad], the middle 99 % of the instants."""
        R = self._joint_rotations(child)
        turns = log_so3(nearest_rotation(R.mean(axis=0)).T @ R)
        _, _, axes = np.linalg.svd(turns - turns.mean(axis=0), full_matrices=False)
        low, high = np.percentile(turns @ axes.T, [0.5, 99.5], axis=0)
        return np.sort(high - low)[::-1]

    def body_with_geometry(self) -> BodyModel:
        """The body with the offsets and mounts of the arrays."""
        index = self.body.segment_index
        joints = tuple(
            replace(joint, parent_T_joint=rigid(np.eye(3), self.offsets[index[joint.child]]))
            for joint in self.body.joints
        )
        mounts = {
            camera: replace(self.body.mounts[camera], segment_T_camera=self.mounts[c])
            for c, camera in enumerate(self.cameras)
        }
        return replace(self.body, joints=joints, mounts=mounts)

    def _joint_rotations(self, child: str) -> Array:
        """(T, 3, 3) parent_R_child of the joint that a segment hangs on."""
        row = self.body.segment_index[child]
        rotations: Array = np.swapaxes(self.rotations[:, self.parent_rows[row]], -1, -2) @ self.rotations[:, row]
        return rotations


def articulated(
    body: BodyModel,
    cameras: tuple[str, ...],
    root_positions: Array,
    rotations: Array,
    twists: Array,
    triggered: NDArray[np.bool_],
) -> ArticulatedMotion:
    """The arrays of a body, its segments' origins moved to their joints, and of its motion (``ArticulatedMotion``)."""
    origins, offsets = np.zeros((2, len(body.segments), 3))
    for joint, (parent, child) in zip(body.tree_joints, body.joint_ends.tolist(), strict=True):
        origins[child] = joint.child_T_joint[:3, 3]
        offsets[child] = joint.parent_T_joint[:3, 3] - origins[parent]
    mounts = np.stack([body.mounts[camera].segment_T_camera for camera in cameras])
    mounts[:, :3, 3] -= origins[[body.segment_index[body.mounts[camera].segment] for camera in cameras]]
    delays = np.zeros(len(cameras))
    return ArticulatedMotion(body, cameras, offsets, mounts, root_positions, rotations, delays, twists, triggered)


def motion_of_cameras(
    body: BodyModel,
    cameras: tuple[str, ...],
    poses: Array,
    twists: Array,
    known: NDArray[np.bool_],
    triggered: NDArray[np.bool_],
) -> ArticulatedMotion:
    """A motion whose segments turn as their cameras do (A 4.2), the root at the median of its places by all cameras.

    Args:
        body: calibrated.
        cameras: (C) names.
        poses: (T, C, 4, 4) world_T_camera.
        twists: (T, C, 6).
        known: (T, C) which of the poses are.
        triggered: (C) whether a camera's stamps are those of the others.
    """
    camera_R_segment = np.stack([body.mounts[camera].segment_T_camera[:3, :3].T for camera in cameras])
    world_R_carrier = poses[..., :3, :3] @ camera_R_segment
    rotations = np.broadcast_to(np.eye(3), (len(poses), len(body.segments), 3, 3)).copy()
    order = [(body.root, None), *((joint.child, joint.parent) for joint in body.tree_joints)]
    for segment, parent in order:
        row = body.segment_index[segment]
        if parent is not None:
            rotations[:, row] = rotations[:, body.segment_index[parent]]
        columns = [c for c, camera in enumerate(cameras) if body.mounts[camera].segment == segment]
        if known[:, columns].any():
            # On average over the cameras that are known, or as at the nearest stamp at which one is.
            stamps = np.flatnonzero(known[:, columns].any(axis=1))
            seen = known[stamps][:, columns].astype(np.float64)
            mean = np.einsum("tk,tkij->tij", seen, world_R_carrier[stamps][:, columns])
            nearest = np.argmin(np.abs(np.arange(len(poses))[:, None] - stamps), axis=1)
            rotations[:, row] = nearest_rotation(mean)[nearest]
    motion = articulated(body, cameras, np.zeros((len(poses), 3)), rotations, twists, triggered)
    shifts = np.where(known[..., None], poses[..., :3, 3] - motion.world_T_camera()[..., :3, 3], np.nan)
    return replace(motion, root_positions=np.nanmedian(shifts, axis=1))


def _turn(row: int) -> slice:
    """Where a segment's rotation stands among the unknowns of an instant."""
    return slice(3 + 3 * row, 6 + 3 * row)


def _orthonormal(poses: Array) -> Array:
    return rigid(nearest_rotation(poses[:, :3, :3]), poses[:, :3, 3])


_STIFFENING = 1e-6
"""Relative to the diagonal: keeps the inverse of an instant in which a segment was not seen."""


@dataclass(frozen=True, eq=False)
class EliminatedInstants:
    """The lasting unknowns' normal equations, of each instant; the moving ones are eliminated.

    Attributes:
        hessians: (T, K, K).
        gradients: (T, K).
        own_steps: (T, M) of the moving unknowns, where the lasting ones stay.
        by_lasting: (T, M, K) how those change with the lasting ones.
    """

    hessians: Array
    gradients: Array
    own_steps: Array
    by_lasting: Array

    def moving(self, lasting: Array) -> Array:
        """The step (T, M) of the moving unknowns for one (K) of the lasting ones."""
        step: Array = self.own_steps + self.by_lasting @ lasting
        return step


def eliminate_instants(J_moving: Array, J_lasting: Array, hessians: Array, gradients: Array) -> EliminatedInstants:
    """Eliminate the moving unknowns.

    Args:
        J_moving: (T, C, 6, M) how the cameras' poses move with the unknowns of their instant.
        J_lasting: (T, C, 6, K) the same with the lasting ones.
        hessians: (T, C, 6, 6) of the cameras' poses.
        gradients: (T, C, 6).
    """
    HJ_moving, HJ_lasting = hessians @ J_moving, hessians @ J_lasting
    flat = (len(J_moving), -1)

    def product(left: Array, right: Array) -> Array:
        columns = left.shape[-1], right.shape[-1]
        rows = left.reshape(*flat, columns[0]), right.reshape(*flat, columns[1])
        out: Array = np.swapaxes(rows[0], 1, 2) @ rows[1]
        return out

    A, B = product(J_moving, HJ_moving), product(J_moving, HJ_lasting)
    a, c = (product(J, gradients[..., None]) for J in (J_moving, J_lasting))
    A = A + (_STIFFENING * np.einsum("tii->ti", A).mean() * np.eye(A.shape[-1]))
    solved = -np.linalg.solve(A, np.concatenate([B, a], axis=2))
    reduced = np.concatenate([product(J_lasting, HJ_lasting), c], axis=2) + np.swapaxes(B, 1, 2) @ solved
    return EliminatedInstants(reduced[..., :-1], reduced[..., -1], solved[..., -1], solved[..., :-1])


def distance_weights(squared: Array, known: NDArray[np.bool_], outlier_sigmas: float) -> Array:
    """Weights (T, C) by each camera's squared distance from where the body puts it, in its own sigmas (Cauchy).

    Args:
        squared: (T, C) Mahalanobis distances.
        known: (T, C) whether there is one; the others weigh nothing.
        outlier_sigmas: distance at which a camera counts half.
    """
    usual = float(np.sqrt(np.median(squared[known]))) if known.any() else 1.0
    # While the body is far from right all cameras are far from it; then the usual distance is no outlier's.
    weights: Array = known / (1.0 + squared / (outlier_sigmas * max(1.0, usual)) ** 2)
    return weights
