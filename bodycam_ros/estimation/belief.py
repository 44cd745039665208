"""The body at one instant as coordinates, their velocities and one covariance; and how two instants hang together.

The coordinates are those of ``kinematics``: the pose of the root and the motion of every joint. So joints are closed in
every state, and the covariance of any segment follows from the same matrix.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from bodycam_ros.geometry import Array
from bodycam_ros.kinematics.tangent import TreeTangent


@dataclass(frozen=True, eq=False)
class Coordinates:
    """Where a body is and how it moves.

    Attributes:
        root: (4, 4) world_T_root [m].
        motion: (J, 4, 4) joint motions.
        velocity: (K) rate of the increments of ``TreeTangent`` [rad/s], [m/s].
    """

    root: Array
    motion: Array
    velocity: Array

    def moved(self, tangent: TreeTangent, step: Array) -> "Coordinates":
        """The coordinates after an increment (2K) of coordinates and velocities, or (K) of coordinates alone."""
        root, motion = tangent.moved(self.root, self.motion, step[: tangent.count])
        rest = step[tangent.count :]
        return Coordinates(root, motion, self.velocity + rest if len(rest) else self.velocity)

    def step_to(self, tangent: TreeTangent, other: "Coordinates") -> Array:
        """The increment (2K) from these coordinates to others."""
        step = tangent.step_between(self.root, self.motion, other.root, other.motion)
        return np.concatenate([step, other.velocity - self.velocity])

    def poses(self, tangent: TreeTangent) -> Array:
        """(S, 4, 4) world_T_segment."""
        return tangent.tree.forward_kinematics(self.root, self.motion)


@dataclass(frozen=True, eq=False)
class Belief:
    """A Gaussian over the increments (2K) about coordinates: ``covariance`` is (2K, 2K)."""

    at: Coordinates
    covariance: Array


@dataclass(frozen=True, eq=False)
class Link:
    """Two instants that follow each other, both as they were known before the later one was measured.

    Attributes:
        before, after: of the earlier and of the later instant.
        cross: (2K, 2K) covariance of the later with the earlier.
    """

    before: Belief
    after: Belief
    cross: Array

    @cached_property
    def _gain(self) -> Array:
        return np.asarray(np.linalg.solve(self.after.covariance, self.cross).T, np.float64)

    def fitted(self, tangent: TreeTangent, after: Belief) -> "Link":
        """The same two instants when the later one was measured."""
        return Link(self.smoothed(tangent, after), after, after.covariance @ self._gain.T)

    def smoothed(self, tangent: TreeTangent, after: Belief, covariance: bool = True) -> Belief:
        """The earlier instant given what is known of the later one by now (Rauch, Tung, Striebel 1965).

        It is the back-substitution of a factor graph that is a chain of instants.
        """
        step = self._gain @ self.after.at.step_to(tangent, after.at)
        at = self.before.at.moved(tangent, step)
        if not covariance:
            return replace(self.before, at=at)
        change = self._gain @ (after.covariance - self.after.covariance) @ self._gain.T
        return Belief(at, self.before.covariance + change)
