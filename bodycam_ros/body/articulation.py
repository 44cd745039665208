"""The articulated body as one vector of unknowns: what stays the same over a recording, and what moves (A eq. 3-5).

Every joint is a ball, so that no joint ever gapes, and a segment turns as its cameras do.

The states of an articulated motion depend on each other through what lasts alone: the body, its mounts, the clocks of
its cameras. Each is eliminated on its own by a Schur complement.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.geometry import (
    adjoint,
    exp_se3,
    inverse,
    log_so3,
    nearest_rotation,
    rigid,
    robust_average_pose,
)
from bodycam_ros.kinematics.tangent import TreeTangent
from bodycam_ros.kinematics.tree import all_motion

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ArticulatedMotion:
    """A body and its motion.

    Attributes:
        body: of ball joints, and free ones to equipment.
        cameras: (C) names.
        motion: (T, 1 + J, 4, 4) of the root and of all joints, in the order of the body's ``tree_joints``.
        delays: (C) by how much the clock of each camera is ahead of the body's [s].
        twists: (T, C, 6) of the cameras, in their own axes [rad/s, m/s].
        triggered: (C) whether a camera's stamps are those of the others.
    """

    body: BodyModel
    cameras: tuple[str, ...]
    motion: Array
    delays: Array
    twists: Array
    triggered: NDArray[np.bool_]

    @cached_property
    def carriers(self) -> list[int]:
        """(C) row of the segment that carries each camera."""
        return [self.body.segment_index[self.body.mounts[camera].segment] for camera in self.cameras]

    @property
    def mounts(self) -> Array:
        """(C, 4, 4) segment_T_camera."""
        return np.stack([self.body.mounts[camera].segment_T_camera for camera in self.cameras])

    @property
    def moving_count(self) -> int:
        """Unknowns of one state: an increment of the tree's coordinates (``TreeTangent``)."""
        return self._tangent.count

    @property
    def lasting_count(self) -> int:
        """Unknowns of the body: each joint's place in its parent, each camera's mount and delay."""
        return 3 * len(self.body.tree_joints) + 7 * len(self.cameras)

    @cached_property
    def _tangent(self) -> TreeTangent:
        return TreeTangent(self.body)

    def place_columns(self, joint_row: int) -> slice:
        """Where a joint's place stands among the lasting unknowns."""
        return slice(3 * joint_row, 3 * joint_row + 3)

    def mount_columns(self, camera_row: int) -> slice:
        """Where a camera's mount stands among the lasting unknowns: rotation, then translation in camera axes."""
        start = 3 * len(self.body.tree_joints) + 6 * camera_row
        return slice(start, start + 6)

    @property
    def delay_columns(self) -> slice:
        """Where the delays stand among the lasting unknowns."""
        return slice(self.lasting_count - len(self.cameras), self.lasting_count)

    def world_T_segment(self) -> Array:
        """Poses (T, S, 4, 4) (A eq. 3-4)."""
        return self.body.poses_of(self.motion)

    def world_T_camera(self) -> Array:
        """Poses (T, C, 4, 4) at what the cameras' clocks call the states (A eq. 5): earlier by their delays."""
        poses: Array = self.world_T_segment()[:, self.carriers] @ self.mounts
        return poses @ exp_se3(-self.delays[:, None] * self.twists) if self.delays.any() else poses

    def moving_jacobians(self) -> Array:
        """(T, C, 6, moving_count) how the cameras' poses, tangents in their own axes, move with their state."""
        J = self._tangent.segment_jacobians(self.world_T_segment())
        return np.asarray(adjoint(inverse(self.mounts)) @ J[:, self.carriers])

    def lasting_jacobians(self) -> Array:
        """(T, C, 6, lasting_count) how they move with the unknowns of the body; see ``moved``."""
        world_R_segment, counts = self.world_T_segment()[..., :3, :3], (len(self.twists), len(self.cameras))
        camera_R_world = np.swapaxes(world_R_segment[:, self.carriers] @ self.mounts[:, :3, :3], -1, -2)
        camera_R_parent = camera_R_world[:, :, None] @ world_R_segment[:, None, self.body.joint_ends[:, 0]]
        camera_R_parent *= self.body.moves[self.carriers][..., None, None]
        lasting = np.zeros((*counts, 6, self.lasting_count))
        places = 3 * len(self.body.tree_joints)
        lasting[..., 3:, :places] = np.swapaxes(camera_R_parent, 2, 3).reshape(*counts, 3, places)
        for c in range(len(self.cameras)):
            lasting[:, c, :, self.mount_columns(c)] = np.eye(6)
        lasting[..., self.delay_columns] = self.delay_jacobians()
        return lasting

    def delay_jacobians(self) -> Array:
        """(T, C, 6, C) how the cameras' poses move with their delays."""
        each = np.arange(len(self.cameras))
        by_delays = np.zeros((*self.twists.shape, len(self.cameras)))
        by_delays[:, each, :, each] = -np.swapaxes(self.twists, 0, 1)
        return by_delays

    def moved(self, moving: Array, lasting: Array) -> "ArticulatedMotion":
        """The motion after a step.

        Args:
            moving: (T, moving_count) increments of the coordinates.
            lasting: (lasting_count) shift of each joint in its parent's axes [m], then a tangent per mount in the
                camera's axes, then what each camera's delay grows by [s].
        """
        joints = tuple(
            replace(joint, parent_T_joint=_shifted(joint.parent_T_joint, lasting[self.place_columns(row)]))
            for row, joint in enumerate(self.body.tree_joints)
        )
        mounts = dict(self.body.mounts)
        for c, camera in enumerate(self.cameras):
            mount = mounts[camera].segment_T_camera @ exp_se3(lasting[self.mount_columns(c)])
            mount = rigid(nearest_rotation(mount[:3, :3]), mount[:3, 3])
            mounts[camera] = replace(mounts[camera], segment_T_camera=mount)
        return replace(
            self,
            body=replace(self.body, joints=joints, mounts=mounts),
            motion=self._tangent.moved(self.motion, moving),
            delays=self.delays + lasting[self.delay_columns],
        )

    def with_zero_at(self, resting: NDArray[np.bool_], world_R_rest: Array) -> "ArticulatedMotion":
        """The same motion, with all segments' axes those of the N-pose (3, 3) on average over some states (T)."""
        poses, body = self.world_T_segment(), self.body
        average = [
            robust_average_pose(rigid(poses[resting, row, :3, :3], np.zeros(3))) for row in range(poses.shape[1])
        ]
        old_T_new = rigid(np.swapaxes(np.array(average)[:, :3, :3], 1, 2) @ world_R_rest, np.zeros(3))
        new_T_old = inverse(old_T_new)
        joints = []
        for joint, (parent, _) in zip(body.tree_joints, body.joint_ends.tolist(), strict=True):
            place = new_T_old[parent] @ joint.parent_T_joint
            joints.append(replace(joint, parent_T_joint=rigid(np.eye(3), place[:3, 3])))
        mounts = {
            camera: replace(
                mount, segment_T_camera=new_T_old[body.segment_index[mount.segment]] @ mount.segment_T_camera
            )
            for camera, mount in body.mounts.items()
        }
        body = replace(body, joints=tuple(joints), mounts=mounts)
        return replace(self, body=body, motion=body.motion_of(poses @ old_T_new))

    def with_body(self, body: BodyModel) -> "ArticulatedMotion":
        """The same motion of the cameras on a body whose joints or root's origin sit elsewhere on its segments."""
        camera = next(camera for camera in self.cameras if body.mounts[camera].segment == body.root)
        old_T_new = self.body.mounts[camera].segment_T_camera @ inverse(body.mounts[camera].segment_T_camera)
        return replace(self, body=body, motion=all_motion(self.motion[:, 0] @ old_T_new, self.motion[:, 1:]))

    def hinge_axis(self, child: str) -> Array:
        """(3,) direction on a segment that its joint never turned across, to the left rather than to the right."""
        R = self.joint_rotations(child)
        axis: Array = np.linalg.svd((R - R.mean(axis=0)).reshape(-1, 3), full_matrices=False)[2][2]
        return axis if axis[1] >= 0 else -axis

    def exercised(self, child: str) -> Array:
        """(3,) extents of a joint's rotation about its principal axes [rad], the middle 99 % of the states."""
        R = self.joint_rotations(child)
        turns = log_so3(nearest_rotation(R.mean(axis=0)).T @ R)
        _, _, axes = np.linalg.svd(turns - turns.mean(axis=0), full_matrices=False)
        low, high = np.percentile(turns @ axes.T, [0.5, 99.5], axis=0)
        return np.sort(high - low)[::-1]

    def joint_rotations(self, child: str) -> Array:
        """(T, 3, 3) of the joint that a segment hangs on."""
        row = self.body.joint_ends[:, 1].tolist().index(self.body.segment_index[child])
        return self.motion[:, 1 + row, :3, :3]


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
        body: calibrated; its joints become balls.
        cameras: (C) names.
        poses: (T, C, 4, 4) world_T_camera.
        twists: (T, C, 6).
        known: (T, C) which of the poses are.
        triggered: (C) whether a camera's stamps are those of the others.
    """
    balls = tuple(
        joint if joint.type == "free" else replace(joint, type="ball", sigmas=None, limits=None)
        for joint in body.tree_joints
    )
    body = replace(body, joints=balls)
    camera_R_segment = np.stack([body.mounts[camera].segment_T_camera[:3, :3].T for camera in cameras])
    world_R_carrier = poses[..., :3, :3] @ camera_R_segment
    rotations = np.tile(np.eye(3), (len(poses), len(body.segments), 1, 1))
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
    root = rigid(rotations[:, body.segment_index[body.root]], np.zeros(3))
    joints = rigid(body.joint_rotations(rigid(rotations, np.zeros(3))), np.zeros(3))
    motion = all_motion(root, joints)
    turned = ArticulatedMotion(body, cameras, motion, np.zeros(len(cameras)), twists, triggered)
    shifts = np.where(known[..., None], poses[..., :3, 3] - turned.world_T_camera()[..., :3, 3], np.nan)
    root = rigid(root[:, :3, :3], np.nanmedian(shifts, axis=1))
    return replace(turned, motion=all_motion(root, joints))


def _shifted(place: Array, shift: Array) -> Array:
    return rigid(place[:3, :3], place[:3, 3] + shift)


_STIFFENING = 1e-6
"""Relative to the diagonal: keeps the inverse of a state in which a segment was not seen."""


@dataclass(frozen=True, eq=False)
class EliminatedStates:
    """The lasting unknowns' normal equations, of each state; the moving ones are eliminated.

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


def eliminate_states(J_moving: Array, J_lasting: Array, hessians: Array, gradients: Array) -> EliminatedStates:
    """Eliminate the moving unknowns.

    Args:
        J_moving: (T, C, 6, M) how the cameras' poses move with the unknowns of their state.
        J_lasting: (T, C, 6, K) the same with the lasting ones.
        hessians: (T, C, 6, 6) of the cameras' poses.
        gradients: (T, C, 6).
    """
    states, cameras, _, moving = J_moving.shape
    lasting, rows = J_lasting.shape[-1], 6 * cameras
    J, HJ = J_moving.reshape(states, rows, moving), (hessians @ J_moving).reshape(states, rows, moving)
    A = np.swapaxes(J, 1, 2) @ HJ
    A += _STIFFENING * np.einsum("tii->ti", A).mean() * np.eye(moving)
    out = EliminatedStates(
        *(np.empty((states, *shape)) for shape in ((lasting, lasting), (lasting,), (moving,), (moving, lasting)))
    )
    # One state after the other, whose matrices stay in the cache.
    for t in range(states):
        J_t = J_lasting[t].reshape(rows, lasting)
        HJ_t = hessians[t] @ J_lasting[t]
        g = gradients[t].ravel()
        B = HJ[t].T @ J_t
        solved = -np.linalg.solve(A[t], np.column_stack([B, J[t].T @ g]))
        out.by_lasting[t], out.own_steps[t] = solved[:, :-1], solved[:, -1]
        out.hessians[t] = J_t.T @ HJ_t.reshape(rows, lasting) + B.T @ out.by_lasting[t]
        out.gradients[t] = J_t.T @ g + B.T @ out.own_steps[t]
    return out


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
