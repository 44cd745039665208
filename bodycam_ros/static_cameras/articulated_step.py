"""One Gauss-Newton step of a body under measurements of its segments, joints closed (B eq. 6-7, on twists).

Unknowns are an increment of the coordinates (``TreeTangent``); equipment beside the person is fixed.
"""

from dataclasses import dataclass

import numpy as np

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.geometry import Array, inverse, log_se3, log_so3
from bodycam_ros.kinematics.joint_angles import JointLimits
from bodycam_ros.kinematics.tangent import TreeTangent

_LIMIT_RAD = 0.1  # of a rotation beyond a joint's limits, which were measured on another day
_RANGE_SHARE = 0.25
"""Sigma of an angle about the middle of its range, as a share of that: what no contour measures, such as the turn of a
round limb about its long axis, returns there within seconds instead of drifting to a limit."""

_LEAST_RAD = 1e-3  # sigma of an angle whose range is a point
_NOTHING_RAD = 1e-9
_DAMPING = 3.0  # [rad], [m] sigma of a step: damping of what is unobserved
_CONVERGED = 1e-9  # change of a pose's entries by a step that moves nothing more


_LOOSE = np.repeat([0.3, 0.05], 3)
"""[rad], [m] deviation of a tried pose from where the images have the segment."""


@dataclass(frozen=True, eq=False)
class PredictedBody:
    """A body as predicted before it is measured.

    Attributes:
        world_T_segment: (S, 4, 4), joints closed.
        root_sigmas: (6,) of the root's rotation [rad] and place [m], in its axes.
        joint_sigma: of the rotation of every joint [rad].
    """

    world_T_segment: Array
    root_sigmas: Array
    joint_sigma: float

    @staticmethod
    def near(poses: Array) -> "PredictedBody":
        """Prediction of a body that was found at about poses (S, 4, 4)."""
        return PredictedBody(poses, _LOOSE, float(_LOOSE[0]))


class ArticulatedStep:
    """Moves the person of a body.

    Args:
        body: segments and joints.
        obeys_limits: whether limits of joints apply, and angles are drawn to the middle of their range.
    """

    def __init__(self, body: BodyModel, obeys_limits: bool = True) -> None:
        self.body = body
        self._tangent = TreeTangent(body)
        self._limits = JointLimits(body)
        self._obeys_limits = obeys_limits
        self._beside = body.named(body.equipment_segments)
        self._columns = np.flatnonzero(~self._tangent.columns_of(self._beside[body.joint_ends[:, 1]]))
        turns = np.zeros((len(body.tree_joints), 3, self._tangent.count))
        stiffness = np.zeros((len(body.tree_joints), 3))
        for row, joint in enumerate(body.tree_joints):
            turns[row, :, self._tangent.columns[row]] = self._tangent.twists[row][:3]
            if joint.type == "ball" and joint.limits and obeys_limits:
                ranges = np.diff(joint.limits)[:, 0]
                axes = ["xyz".index(axis) for axis in joint.angle_axes]
                stiffness[row, axes] = np.maximum(_RANGE_SHARE * ranges, _LEAST_RAD) ** -2.0
        self._turns, self._stiffness = turns[..., self._columns], stiffness
        self._middle = self._limits.middle()

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
        step = np.zeros(self._tangent.count)
        step[self._columns] = np.linalg.solve(A, b)
        moved = self._tangent.moved(self.body.motion_of(poses), step)
        return self._beside_as(poses, self.body.poses_of(moved))

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
            prior = predicted or PredictedBody(poses, np.full(6, _DAMPING), _DAMPING)
            before, poses = poses, self.apply(poses, summed, vector, prior)
            if np.abs(poses - before).max() < _CONVERGED:
                break
        return poses

    def close_joints(self, poses: Array) -> Array:
        """The nearest poses (S, 4, 4) of the root and of all joints' rotations that leave no gap."""
        closed = self.body.forward_kinematics(poses[self._tangent.root], self.body.joint_rotations(poses))
        return self._beside_as(poses, closed)

    def jacobians(self, poses: Array) -> Array:
        """(S, 6, K) changes of world_T_segment in the segments' axes with the unknowns."""
        J = self._tangent.segment_jacobians(poses)[..., self._columns]
        J[self._beside] = 0.0
        return J

    def add_prediction(self, A: Array, b: Array, poses: Array, predicted: PredictedBody) -> None:
        """Add the predictions of root and joints, and the joints' limits, to the normal equations."""
        before, root = predicted.world_T_segment, self._tangent.root
        weights = predicted.root_sigmas**-2.0
        A[range(6), range(6)] += weights
        b[:6] -= weights * log_se3(inverse(before[root]) @ poses[root])
        rotations, rotations_before = self.body.joint_rotations(np.stack([poses, before]))
        within = self._limits.clamp(rotations) if self._obeys_limits else rotations
        references = np.stack([within, rotations_before, self._middle])
        beyond, since_before, off_middle = log_so3(rotations @ np.swapaxes(references, 2, 3))
        far = np.linalg.norm(beyond, axis=1)[:, None]
        along = beyond / np.maximum(far, _NOTHING_RAD) * (far > _NOTHING_RAD) / _LIMIT_RAD
        joint_weight = predicted.joint_sigma**-2.0
        information = (self._stiffness + joint_weight)[..., None] * np.eye(3) + along[:, :, None] * along[:, None]
        pull = joint_weight * since_before + beyond / _LIMIT_RAD**2 + self._stiffness * off_middle
        turns = rotations @ self._turns  # in the axes of the joint on its parent
        J = turns.reshape(-1, A.shape[0])
        A += J.T @ (information @ turns).reshape(J.shape)
        b -= pull.ravel() @ J

    def _beside_as(self, poses: Array, moved: Array) -> Array:
        """Moved poses (S, 4, 4), equipment where it was."""
        moved[self._beside] = poses[self._beside]
        return moved
