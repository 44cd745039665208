"""The body in one state as coordinates, their velocities and one covariance; and the covariance of two states.

The coordinates are those of ``kinematics``: the pose of the root and the motion of every joint. So joints are closed in
every state, and the covariance of any segment follows from the same matrix.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from bodycam_ros.body_state import BodyUncertainty
from bodycam_ros.geometry import Array
from bodycam_ros.kinematics.tangent import TreeTangent


@dataclass(frozen=True, eq=False)
class Coordinates:
    """Where a body is and how it moves; of several states (``stacked``) each array has one more axis in front.

    Attributes:
        root: (4, 4) world_T_root [m].
        motion: (J, 4, 4) joint motions.
        velocity: (K) rate of the increments of ``TreeTangent`` [rad/s], [m/s].
    """

    root: Array
    motion: Array
    velocity: Array

    @staticmethod
    def stacked(first: "Coordinates", second: "Coordinates") -> "Coordinates":
        """Those of two states, whose Jacobians and increments cost hardly more together than those of one."""
        pairs = zip(*((of.root, of.motion, of.velocity) for of in (first, second)), strict=True)
        return Coordinates(*(np.stack(pair) for pair in pairs))

    def __getitem__(self, row: int) -> "Coordinates":
        """One of several states."""
        return Coordinates(self.root[row], self.motion[row], self.velocity[row])

    def moved(self, tangent: TreeTangent, step: Array) -> "Coordinates":
        """The coordinates after an increment (2K) of coordinates and velocities, or (K) of coordinates alone."""
        root, motion = tangent.moved(self.root, self.motion, step[..., : tangent.count])
        rest = step[..., tangent.count :]
        return Coordinates(root, motion, self.velocity + rest if rest.shape[-1] else self.velocity)

    def step_to(self, tangent: TreeTangent, other: "Coordinates") -> Array:
        """The increment (2K) from these coordinates to others."""
        step = tangent.step_between(self.root, self.motion, other.root, other.motion)
        return np.concatenate([step, other.velocity - self.velocity], axis=-1)

    def poses(self, tangent: TreeTangent) -> Array:
        """(S, 4, 4) world_T_segment."""
        return tangent.tree.forward_kinematics(self.root, self.motion)


@dataclass(frozen=True, eq=False)
class Estimate:
    """A Gaussian over the increments (2K) about coordinates: ``covariance`` is (2K, 2K)."""

    at: Coordinates
    covariance: Array


@dataclass(frozen=True, eq=False)
class Transition:
    """Two states that follow each other, both given all but the later one's measurements.

    Attributes:
        before, after: the earlier and the later state.
        cross: (2K, 2K) covariance of the later with the earlier.
    """

    before: Estimate
    after: Estimate
    cross: Array

    @cached_property
    def _gain(self) -> Array:
        return np.asarray(np.linalg.solve(self.after.covariance, self.cross).T, np.float64)

    def fitted(self, tangent: TreeTangent, after: Estimate) -> "Transition":
        """The same two states given the later one's measurements."""
        return Transition(self.smoothed(tangent, after), after, after.covariance @ self._gain.T)

    def smoothed(self, tangent: TreeTangent, after: Estimate, covariance: bool = True) -> Estimate:
        """The earlier state given another estimate of the later one (Rauch, Tung, Striebel 1965).

        It is the back-substitution of a factor graph that is a chain of states.
        """
        step = self._gain @ self.after.at.step_to(tangent, after.at)
        at = self.before.at.moved(tangent, step)
        if not covariance:
            return replace(self.before, at=at)
        change = self._gain @ (after.covariance - self.after.covariance) @ self._gain.T
        return Estimate(at, self.before.covariance + change)


_CORRELATED_S = 0.3  # errors of registrations last so long (0.9 from image to image at 30 Hz): differences err less
_BODY = np.diag(np.repeat([0.0002, 0.0006], 3) ** 2)  # [rad], [m] of the calibrated body, the same in all states


def body_uncertainty(estimate: Estimate, tangent: TreeTangent, dt_s: float, root_observed: bool) -> BodyUncertainty:
    """Covariances of an estimate.

    Args:
        estimate: of the state.
        tangent: its coordinates.
        dt_s: since the state before [s]; 0 where there is none.
        root_observed: whether a camera observes the root.
    """
    K, P = tangent.count, estimate.covariance
    J = tangent.segment_jacobians(estimate.at.poses(tangent))
    segments = (J.reshape(-1, K) @ P[:K, :K]).reshape(J.shape) @ np.swapaxes(J, -1, -2) + _BODY
    joints = np.zeros((len(tangent.twists), 3, 3))
    for row, (joint, columns) in enumerate(zip(tangent.tree.tree_joints, tangent.columns, strict=True)):
        turns = joint.child_T_joint[:3, :3] @ tangent.twists[row][:3]
        joints[row] = turns @ P[columns, columns] @ turns.T
    root = segments[tangent.tree.segment_index[tangent.tree.root]]
    twist = P[K : K + 6, K : K + 6].copy()
    if root_observed and dt_s > 0.0:
        # The difference of two poses whose errors are nearly the same.
        twist = 2.0 * (1.0 - np.exp(-dt_s / _CORRELATED_S)) / dt_s**2 * root
    return BodyUncertainty(root, twist, joints, segments)
