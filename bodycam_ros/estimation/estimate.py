"""The body in one state as coordinates, their velocities and one covariance; and the covariance of two states.

The coordinates are those of ``kinematics``: the pose of the root and the motion of every joint. So joints are closed in
every state, and the covariance of any segment follows from the same matrix.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple, Protocol

import numpy as np

from bodycam_ros.body_state import BodyUncertainty
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
    """Where a body is and how it moves; of several states (``stacked``) each array has one more axis in front.

    Attributes:
        tangent: of the body.
        motion: (1 + J, 4, 4) of the root, world_T_root [m], and of all joints.
        velocity: (K) rate of the increments of ``TreeTangent`` [rad/s], [m/s].
    """

    tangent: TreeTangent
    motion: Array
    velocity: Array

    @staticmethod
    def stacked(first: "Coordinates", second: "Coordinates") -> "Coordinates":
        """Those of two states, whose Jacobians and increments cost hardly more together than those of one."""
        motion, velocity = np.stack([first.motion, second.motion]), np.stack([first.velocity, second.velocity])
        return Coordinates(first.tangent, motion, velocity)

    def __getitem__(self, row: int) -> "Coordinates":
        """One of several states."""
        return Coordinates(self.tangent, self.motion[row], self.velocity[row])

    @property
    def joints(self) -> Array:
        """(J, 4, 4) joint motions."""
        return self.motion[..., 1:, :, :]

    def placed(self, joints: Array) -> "Coordinates":
        """The same with other joint motions (J, 4, 4)."""
        return replace(self, motion=all_motion(self.motion[0], joints))

    def moved(self, step: Array) -> "Coordinates":
        """The coordinates after an increment (2K) of coordinates and velocities, or (K) of coordinates alone."""
        K = self.tangent.count
        velocity = self.velocity + step[..., K:] if step.shape[-1] > K else self.velocity
        return Coordinates(self.tangent, self.tangent.moved(self.motion, step[..., :K]), velocity)

    def step_to(self, other: "Coordinates") -> Array:
        """The increment (2K) from these coordinates to others."""
        step = self.tangent.step_between(self.motion, other.motion)
        return np.concatenate([step, other.velocity - self.velocity], axis=-1)

    @cached_property
    def poses(self) -> Array:
        """(S, 4, 4) world_T_segment."""
        return self.tangent.tree.poses_of(self.motion)

    @cached_property
    def jacobians(self) -> Array:
        """(S, 6, K) of the poses, tangents in the segments' axes."""
        return self.tangent.segment_jacobians(self.poses)


@dataclass(frozen=True, eq=False)
class Estimate:
    """A Gaussian over the increments (2K) about coordinates: ``covariance`` is (2K, 2K)."""

    at: Coordinates
    covariance: Array

    @cached_property
    def information(self) -> Array:
        """(K, K) inverse of the covariance of the coordinates."""
        K = self.at.tangent.count
        information = np.linalg.inv(self.covariance[:K, :K])
        return np.asarray(0.5 * (information + information.T), np.float64)


class MotionPrior(NamedTuple):
    """How coordinates move that are not people's.

    Attributes:
        density: (K) spectral densities of their accelerations; NaN of coordinates that move as people do.
        fade_s: (K) in which velocities fade [s].
    """

    density: Array
    fade_s: Array


class Between(Protocol):
    """A measurement of one segment in two states."""

    @property
    def row(self) -> int:
        """Of the segment."""

    def residual(self, before: Array, after: Array, *twists: Array) -> tuple[Array, Array, Array]:
        """Its residual (M) in sigmas, of the earlier and the later pose (4, 4) and twist (6).

        With it come the rows (M, 12) by which tangents of the later pose and twist, and of the earlier, lessen it.
        """


@dataclass(frozen=True, eq=False)
class Transition:
    """A state and the one before, both given the same measurements: none at first, in the end all until then.

    Attributes:
        before, after: the earlier and the later state.
        cross: (2K, 2K) covariance of the later with the earlier.
        dt_s: between the two [s]; 0 at the first state.
        prior: of the motion between them, where it is not people's.
        between: measurements of both.
    """

    before: Estimate
    after: Estimate
    cross: Array
    dt_s: float
    prior: MotionPrior | None = None
    between: tuple[Between, ...] = ()

    @staticmethod
    def first(initial: Estimate) -> "Transition":
        """Of the first state, which depends on none before."""
        return Transition(initial, initial, np.zeros_like(initial.covariance), 0.0)

    @cached_property
    def _gain(self) -> Array:
        return np.asarray(np.linalg.solve(self.after.covariance, self.cross).T, np.float64)

    def fitted(self, at: Coordinates, covariance: Array, step: Array) -> "Transition":
        """The same given a fit of the later state's coordinates; all else follows by its covariance with these.

        Args:
            at: the coordinates of the fit.
            covariance: (K, K) of them.
            step: (K) increment from the coordinates before the fit.
        """
        prior, P, cross = self.after.information, self.after.covariance, self.cross
        K = len(prior)
        gain, gain_before, less = P[K:, :K] @ prior, cross[:K].T @ prior, P[:K, :K] - covariance
        after, covaries = np.empty_like(P), np.empty_like(cross)
        # By the fit itself: as a difference from the prediction, a million times as large, it is lost in rounding.
        after[:K, :K], after[K:, :K] = covariance, gain @ covariance
        after[:K, K:] = after[K:, :K].T
        after[K:, K:] = P[K:, K:] - gain @ less @ gain.T
        covaries[:K], less_before = covariance @ gain_before.T, less @ gain_before.T
        covaries[K:] = cross[K:] - gain @ less_before
        before = Estimate(self.before.at.moved(gain_before @ step), self.before.covariance - gain_before @ less_before)
        at = replace(at, velocity=self.after.at.velocity + gain @ step)
        return replace(self, before=before, after=Estimate(at, after), cross=covaries)

    def smoothed(self, after: Coordinates) -> Coordinates:
        """The earlier state where the later one is at other coordinates (Rauch, Tung, Striebel 1965).

        It is the back-substitution of a factor graph that is a chain of states.
        """
        return self.before.at.moved(self._gain @ self.after.at.step_to(after))


_CORRELATED_S = 0.3  # errors of registrations last so long (0.9 from image to image at 30 Hz): differences err less
_BODY = np.diag(np.repeat([0.0002, 0.0006], 3) ** 2)  # [rad], [m] of the calibrated body, the same in all states


def body_uncertainty(estimate: Estimate, dt_s: float, root_observed: bool) -> BodyUncertainty:
    """Covariances of an estimate.

    Args:
        estimate: of the state.
        dt_s: since the state before [s]; 0 where there is none.
        root_observed: whether a camera observes the root.
    """
    tangent, P, J = estimate.at.tangent, estimate.covariance, estimate.at.jacobians
    K = tangent.count
    segments = (J.reshape(-1, K) @ P[:K, :K]).reshape(J.shape) @ np.swapaxes(J, -1, -2) + _BODY
    joints = tangent.child_turns @ P[:K, :K] @ np.swapaxes(tangent.child_turns, -1, -2)
    root = segments[tangent.tree.segment_index[tangent.tree.root]]
    twist = P[K : K + 6, K : K + 6].copy()
    if root_observed and dt_s > 0.0:
        # The difference of two poses whose errors are nearly the same.
        twist = 2.0 * (1.0 - np.exp(-dt_s / _CORRELATED_S)) / dt_s**2 * root
    return BodyUncertainty(root, twist, joints, segments)
