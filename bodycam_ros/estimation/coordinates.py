"""The body in one state as coordinates and velocities, and the vectors by which gtsam has them.

The coordinates are those of ``kinematics``: the pose of the root and the motion of every joint. So joints are closed in
every state, and the covariance of any segment follows from that of the coordinates.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from bodycam_ros.geometry import Array
from bodycam_ros.kinematics.tangent import TreeTangent
from bodycam_ros.kinematics.tree import all_motion

UNKNOWN = 1.0
"""Sigma of what nothing measured [rad], [m]."""

FREE_RAD = 0.5
"""Sigma of a joint of which nothing is known but that it is a person's [rad]."""

LINEAR, SETTLED, STEPS = 0.1, 0.01, 10
"""A step after which residuals of cameras are linear enough to be judged, one after which a fit ends [rad], [m]; so
many steps at most."""


@dataclass(frozen=True, eq=False)
class Coordinates:
    """Where a body is and how it moves.

    Attributes:
        tangent: of the body.
        motion: (1 + J, 4, 4) of the root, world_T_root [m], and of all joints.
        velocity: (K) rate of the increments of ``TreeTangent`` [rad/s], [m/s].
    """

    tangent: TreeTangent
    motion: Array
    velocity: Array

    @property
    def joints(self) -> Array:
        """(J, 4, 4) joint motions."""
        return self.motion[1:]

    def placed(self, joints: Array) -> "Coordinates":
        """The same with other joint motions (J, 4, 4)."""
        return replace(self, motion=all_motion(self.motion[0], joints))

    def moved(self, step: Array) -> "Coordinates":
        """The coordinates after an increment (K); velocities stay."""
        return Coordinates(self.tangent, self.tangent.moved(self.motion, step), self.velocity)

    def step_to(self, other: "Coordinates") -> Array:
        """The increment (K) from these coordinates to others."""
        step: Array = self.tangent.step_between(self.motion, other.motion)
        return step

    @cached_property
    def poses(self) -> Array:
        """(S, 4, 4) world_T_segment."""
        return self.tangent.tree.poses_of(self.motion)

    @cached_property
    def jacobians(self) -> Array:
        """(S, 6, K) of the poses, tangents in the segments' axes."""
        return self.tangent.segment_jacobians(self.poses)


class Chart:
    """Vectors of one state about its origin: the variable that gtsam has.

    A vector (2K) has the velocities first, then the increment of the coordinates; a vector (K) has the increment alone.
    With the velocities first, the last K rows of a triangular square root of its information are those of the
    coordinates alone, whatever the velocities are.

    Args:
        origin: coordinates whose vector is zero.

    Attributes:
        origin: as given.
        size: K.
    """

    def __init__(self, origin: Coordinates) -> None:
        self.origin, self.size = origin, origin.tangent.count
        self._latest: tuple[bytes, Coordinates] | None = None

    def at(self, x: Array) -> Coordinates:
        """Coordinates of a vector."""
        key = x.tobytes()
        if self._latest is None or self._latest[0] != key:
            # All factors of a state are evaluated at the same vector, one after the other.
            step, origin = x[-self.size :], self.origin
            motion = origin.tangent.moved(origin.motion, step) if step.any() else origin.motion
            velocity = origin.velocity + x[: self.size] if len(x) > self.size else origin.velocity
            self._latest = key, Coordinates(origin.tangent, motion, velocity)
        return self._latest[1]

    def vector(self, at: Coordinates) -> Array:
        """The vector (2K) of coordinates."""
        return np.concatenate([at.velocity - self.origin.velocity, self.origin.step_to(at)])

    def by_vector(self, by_step: Array, x: Array) -> Array:
        """Jacobian (M, K) by the increment in a vector, of one (M, K) by an increment of the coordinates there."""
        step = x[-self.size :]
        if not step.any():
            return by_step
        chained: Array = by_step @ self.origin.tangent.step_jacobian(step)
        return chained
