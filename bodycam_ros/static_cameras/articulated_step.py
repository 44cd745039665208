"""One Gauss-Newton step of a body under measurements of its segments, joints closed (B eq. 6-7, on twists).

Unknowns are a twist of the root and a rotation of each joint, in the axes of the world about the root's origin; a
joint's rotation moves all its descendants.
"""

from dataclasses import dataclass

import numpy as np

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.geometry import Array, exp_so3, hat, inverse, log_so3, rigid
from bodycam_ros.kinematics.joint import Joint
from bodycam_ros.kinematics.joint_angles import JointLimits
from bodycam_ros.kinematics.tangent import tangents_of

_ROOT = 6
_STIFF_RAD = 1e-3  # of a rotation that a joint's type excludes
_LIMIT_RAD = 0.1  # of a rotation beyond a joint's limits, which were measured on another day
_RANGE_SHARE = 0.25
"""Sigma of an angle about the middle of its range, as a share of that: what no contour measures, such as the turn of a
round limb about its long axis, returns there within seconds instead of drifting to a limit."""

_NOTHING_RAD = 1e-9
_DAMPING = 3.0  # [rad], [m] sigma of a step: damping of what is unobserved
_CONVERGED = 1e-9  # change of a pose's entries by a step that moves nothing more


@dataclass(frozen=True, eq=False)
class PredictedBody:
    """A body as predicted before it is measured.

    Attributes:
        world_T_segment: (S, 4, 4), joints closed.
        root_sigmas: (6,) of the root's rotation [rad] and place [m].
        joint_sigma: of the rotation of every joint [rad].
    """

    world_T_segment: Array
    root_sigmas: Array
    joint_sigma: float


class ArticulatedStep:
    """Moves the person of a body; its equipment is fixed.

    Args:
        body: segments and joints.
        obeys_limits: whether limits of joints apply, and angles are drawn to the middle of their range.
    """

    def __init__(self, body: BodyModel, obeys_limits: bool = True) -> None:
        self._body = body
        self._root = body.segment_index[body.root]
        self._beside = [body.segment_index[segment] for segment in body.equipment_segments]
        joints = [
            (row, joint) for row, joint in enumerate(body.tree_joints) if joint.child not in body.equipment_segments
        ]
        self._rows = [row for row, _ in joints]
        in_body = np.ones(len(body.segments))
        in_body[self._beside] = 0.0
        self._turns = in_body[:, None] * body.moves[:, self._rows]
        self._moves = np.concatenate([np.outer(in_body, np.ones(_ROOT)), self._turns.repeat(3, axis=1)], axis=1)
        unknowns = _ROOT + np.arange(3 * len(joints)).reshape(-1, 3)
        self._blocks = unknowns[:, :, None], unknowns[:, None]
        self._stiffness = np.array([_stiffness(joint, obeys_limits) for _, joint in joints]).reshape(-1, 3, 3)
        limits = JointLimits(body)
        self._limits = limits if obeys_limits else None
        self._middle = limits.middle()[self._rows]

    def apply(self, poses: Array, information: Array, vector: Array, predicted: PredictedBody) -> Array:
        """Poses (S, 4, 4) after one Gauss-Newton step from poses (S, 4, 4) whose joints are closed.

        Args:
            poses: where it begins.
            information, vector: (S, 6, 6), (S, 6) normal equations of each segment by itself, for a change of
                world_T_segment in the segments' axes, rotation first.
            predicted: prior of the root and the joints.
        """
        J = self.jacobians(poses)
        size = J.shape[2]
        A = J.reshape(-1, size).T @ (information @ J).reshape(-1, size)
        b = vector.ravel() @ J.reshape(-1, size)
        self.add_prediction(A, b, poses, predicted)
        return self._applied(poses, np.asarray(np.linalg.solve(A, b), np.float64))

    def fit(
        self,
        start: Array,
        rows: list[int],
        measured: Array,
        information: Array,
        predicted: PredictedBody | None = None,
        steps: int = 30,
    ) -> Array:
        """Poses (S, 4, 4), joints closed, nearest to measured ones of some segments.

        Args:
            start: (S, 4, 4) where it begins.
            rows: (N,) of the segments that were measured, once or several times.
            measured: (N, 4, 4) world_T_segment.
            information: (N, 6, 6) of them, in the segments' axes, rotation first.
            predicted: prior of the root and the joints; without it what is unobserved stays as it was.
            steps: at most.
        """
        poses = self.close_joints(start)
        summed = np.zeros((len(start), 6, 6))
        np.add.at(summed, rows, information)
        for _ in range(steps):
            segment_T_measured = inverse(poses[rows]) @ measured
            off = np.concatenate([log_so3(segment_T_measured[:, :3, :3]), segment_T_measured[:, :3, 3]], axis=1)
            vector = np.zeros((len(start), 6))
            np.add.at(vector, rows, (information @ off[..., None])[..., 0])
            prior = predicted or PredictedBody(poses, np.full(_ROOT, _DAMPING), _DAMPING)
            before, poses = poses, self.apply(poses, summed, vector, prior)
            if np.abs(poses - before).max() < _CONVERGED:
                break
        return poses

    def close_joints(self, poses: Array) -> Array:
        """The nearest poses (S, 4, 4) of the root and of all joints' rotations that leave no gap."""
        closed = self._body.forward_kinematics(poses[self._root], self._body.joint_rotations(poses))
        closed[self._beside] = poses[self._beside]
        return closed

    def jacobians(self, poses: Array) -> Array:
        """(S, 6, 6 + 3 J) changes of world_T_segment in the segments' axes with the unknowns."""
        # A turn w about a pivot p moves the point at the world's origin by p x w.
        pivots = hat(np.concatenate([poses[None, self._root, :3, 3], self._world_T_joint(poses)[:, :3, 3]]))
        twists = np.concatenate([np.broadcast_to(np.eye(3), pivots.shape), pivots], axis=1)
        shifts = np.concatenate([np.zeros((3, 3)), np.eye(3)])
        return tangents_of(poses, np.concatenate([twists[0], shifts, *twists[1:]], axis=1), self._moves)

    def add_prediction(self, A: Array, b: Array, poses: Array, predicted: PredictedBody) -> None:
        """Add the predictions of root and joints, and the joints' limits, to the normal equations."""
        before = predicted.world_T_segment
        root, root_before = poses[self._root], before[self._root]
        deviation = np.concatenate([log_so3(root[:3, :3] @ root_before[:3, :3].T), root[:3, 3] - root_before[:3, 3]])
        weights = predicted.root_sigmas**-2.0
        A[range(_ROOT), range(_ROOT)] += weights
        b[:_ROOT] -= weights * deviation
        rotations, rotations_before = self._body.joint_rotations(np.stack([poses, before]))
        turned, turned_before = rotations[self._rows], rotations_before[self._rows]
        world_R_joint = self._world_T_joint(poses)[:, :3, :3]
        joint_R_world = np.swapaxes(world_R_joint, 1, 2)
        within = (rotations if self._limits is None else self._limits.clamp(rotations))[self._rows]
        references = np.swapaxes([within, turned_before, self._middle], 2, 3)
        beyond, since_before, off_middle = log_so3(turned @ references)
        far = np.linalg.norm(beyond, axis=1)[:, None]
        along = beyond / np.maximum(far, _NOTHING_RAD) * (far > _NOTHING_RAD) / _LIMIT_RAD
        information = self._stiffness + predicted.joint_sigma**-2.0 * np.eye(3) + along[:, :, None] * along[:, None]
        pull = predicted.joint_sigma**-2.0 * since_before + beyond / _LIMIT_RAD**2
        pull += (self._stiffness @ off_middle[..., None])[..., 0]
        information = world_R_joint @ information @ joint_R_world
        pull = (world_R_joint @ pull[..., None])[..., 0]
        A[self._blocks] += information
        b[_ROOT:] -= pull.ravel()

    def _world_T_joint(self, poses: Array) -> Array:
        return self._body.world_T_joint(poses)[self._rows]

    def _applied(self, poses: Array, step: Array) -> Array:
        """Poses (S, 4, 4) moved by the unknowns, joints closed: turns add up along the chain, places follow."""
        turns = step[:3] + self._turns @ step[_ROOT:].reshape(-1, 3)
        turns[self._beside] = 0.0
        moved = poses.copy()
        moved[:, :3, :3] = exp_so3(turns) @ poses[:, :3, :3]
        moved[self._root] = rigid(moved[self._root, :3, :3], poses[self._root, :3, 3] + step[3:_ROOT])
        return self.close_joints(moved)


def _stiffness(joint: Joint, obeys_limits: bool) -> Array:
    """Information (3, 3), in a joint's axes, against turns that its type forbids or that are far off its middle."""
    axes = joint.axes_of_rotation
    weights = np.zeros(3) if joint.type == "ball" else np.full(3, _STIFF_RAD**-2.0)
    if joint.type == "hinge":
        weights[0] = 0.0
    if joint.type == "ball" and joint.limits and obeys_limits:
        for axis, (low, high) in zip(joint.angle_axes, joint.limits, strict=True):
            weights["xyz".index(axis)] = max(_RANGE_SHARE * (high - low), _STIFF_RAD) ** -2.0
    information: Array = axes.T @ (weights[:, None] * axes)
    return information
