"""The pose prior: what the joints that are seen tell of a limb that nothing sees.

A limb without a camera that sees is held by its joint alone. People move their limbs together, so the prior is the mean
and the covariance of all joint rotations that were observed of this body so far. Given the joints that are seen, a
Gaussian tells the others: their expectation and how far from it they have been.
"""

from collections.abc import Collection

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.estimation.measurements import JointRotations
from bodycam_ros.geometry import Array, exp_so3, log_so3
from bodycam_ros.kinematics.joint import Joint, hinge_angle
from bodycam_ros.kinematics.limits import JointLimits

Mask = NDArray[np.bool_]

_NOISE_RAD = 0.05
"""Motion of the seen joints below this says nothing of the others."""

_LEAST_RAD = 0.07
"""An unseen joint is never known better than this."""

_ASSUMED_S = 0.15
"""For this long a joint must be seen to outweigh what was assumed of it."""

_LASTS_S = 0.2
"""A limb stays on one side of its expectation for about this long: the instants of this time are one measurement."""

_TURNING_LASTS_S = 3.0
"""The same for a limb whose rotation is measured from image to image: it stays where it is beside its expectation."""

_UNKNOWN_RAD = 0.35
"""Spread of a joint about the N-pose that is assumed until it has been seen, where no range is known."""

FORGET_S = 60.0
"""People change what they do: older poses count less and less."""


class PosePrior:
    """A Gaussian over all joint rotations, learned while they are observed.

    The rotation of each joint is a rotation vector (3) from the middle of its limits, so that an arm that is raised
    overhead is nowhere near the vector's jump at half a turn.

    Args:
        body: joints and their limits.
        machine: names of joints that are no person's: what they do tells of the others, and nothing tells of them.

    Attributes:
        noise_rad: motion that says nothing of other joints.
        limits: of the joints, widened to what has been seen.
        machine_is_known: whether the machine's joints are.
    """

    noise_rad = _NOISE_RAD

    def __init__(self, body: BodyModel, machine: Collection[str] = frozenset[str]()) -> None:
        self._machine = np.array([joint.name in machine for joint in body.tree_joints], bool)
        self.machine_is_known = False
        self._axes = {
            row: joint.axis
            for row, joint in enumerate(body.tree_joints)
            if self._machine[row] and joint.type == "hinge"
        }
        self.limits = JointLimits(body)
        self._middle_R = self.limits.middle()
        self._rest = log_so3(np.swapaxes(self._middle_R, -1, -2)).ravel()
        spans = np.array([_spans(joint) for joint in body.tree_joints]).reshape(-1, 3)
        spans[self._machine] = 1.0
        self._rest_variance = np.ravel(spans**2)
        # Sums over the instants at which both of two components were seen: seconds, first component, product.
        size = 3 * len(body.tree_joints)
        self._seconds, self._sums, self._products = (np.zeros((size, size)) for _ in range(3))
        self._learned: tuple[Array, Array] | None = None

    def remember(self, rotations: Array, seen: Mask, dt_s: float) -> None:
        """Learn joint rotations (J, 3, 3) of which some (J,) were seen, and that lasted for ``dt_s``."""
        self._learned = None
        seen = seen | (self._machine & self.machine_is_known)
        kept = np.exp(-dt_s / FORGET_S)
        self.limits = self.limits.widened(rotations, seen)
        x = self.vectors(rotations)
        mask = np.repeat(seen, 3).astype(float)
        both = dt_s * np.outer(mask, mask)
        self._seconds = kept * self._seconds + both
        self._sums = kept * self._sums + both * x[:, None]
        self._products = kept * self._products + both * np.outer(x, x)

    def expect(self, rotations: Array, seen: Mask, turning: Mask, dt_s: float) -> JointRotations:
        """Where joints are that are not seen: the Gaussian's conditional.

        Args:
            rotations: (J, 3, 3) joint rotations; those of unseen joints do not matter.
            seen: (J,) whether both of a joint's segments are.
            turning: (J,) whether the rotation of what is not seen is measured at least.
            dt_s: how long the instant lasts [s].
        """
        seen = seen | (self._machine & self.machine_is_known)
        unseen = ~seen & ~self._machine
        rows = np.flatnonzero(unseen)
        if len(rows) == 0 or not seen.any():
            return JointRotations.nothing()
        self._learned = self._learned or self._gaussian()
        mean, covariance = self._learned
        known, wanted = np.repeat(seen, 3), np.repeat(unseen, 3)
        noisy = covariance[np.ix_(known, known)] + _NOISE_RAD**2 * np.eye(int(known.sum()))
        gain = np.linalg.solve(noisy, covariance[np.ix_(known, wanted)]).T
        spread = covariance[np.ix_(wanted, wanted)] - gain @ covariance[np.ix_(known, wanted)]
        # A pose unlike all that were seen must not throw the others farther than they have ever been.
        reach = 2.0 * np.sqrt(np.diag(covariance)[wanted])
        expected = mean.copy()
        expected[wanted] += np.clip(gain @ (self.vectors(rotations) - mean)[known], -reach, reach)
        lasts_s = np.where(turning, _TURNING_LASTS_S, _LASTS_S)[rows]
        shared = np.maximum(1.0, lasts_s / dt_s)[:, None]
        variances = np.maximum(np.diag(spread).reshape(-1, 3), _LEAST_RAD**2) * shared
        return JointRotations(rows, self.limits.clamp(self._rotations(expected))[rows], np.sqrt(variances))

    def _gaussian(self) -> tuple[Array, Array]:
        """Mean (3J) and covariance (3J, 3J) of what was seen, begun with what is assumed."""
        prior_s = _ASSUMED_S
        alone_s = np.diag(self._seconds)
        mean = (np.diag(self._sums) + prior_s * self._rest) / (alone_s + prior_s)
        # About the mean: sum of (x - m)(y - n) over the instants that saw both.
        cross = self._products - self._sums * mean - (self._sums * mean).T + self._seconds * np.outer(mean, mean)
        covariance = cross / (self._seconds + prior_s)
        covariance[np.diag_indices_from(covariance)] += prior_s * self._rest_variance / (alone_s + prior_s)
        # Pairs that were seen at different times do not make one covariance by themselves.
        values, vectors = np.linalg.eigh(covariance)
        return mean, (vectors * np.maximum(values, 0.0)) @ vectors.T

    def vectors(self, rotations: Array) -> Array:
        """Rotation vectors (3 J) of joint rotations (J, 3, 3), from the middle of each joint's limits."""
        vectors: Array = log_so3(np.swapaxes(self._middle_R, -1, -2) @ rotations)
        if self._machine.any():
            # A crank turns for ever, and legs follow it: sine and cosine instead of an angle that jumps.
            vectors[self._machine] = 0.0
            for row, axis in self._axes.items():
                angle = hinge_angle(rotations[row], axis)
                vectors[row, :2] = np.cos(angle), np.sin(angle)
        return vectors.ravel()

    def rotation(self, row: int, vector: Array) -> Array:
        """The rotation (3, 3) of one joint of the tree, of its vector (3,)."""
        R: Array = self._middle_R[row] @ exp_so3(vector)
        return R

    def _rotations(self, vectors: Array) -> Array:
        rotations: Array = self._middle_R @ exp_so3(vectors.reshape(-1, 3))
        return rotations


def _spans(joint: Joint) -> Array:
    """Spread of a joint about its x, y and z [rad] as its range tells: people are within a quarter of it mostly."""
    spans = np.full(3, _UNKNOWN_RAD)
    if joint.limits and joint.type == "ball":
        for axis, (low, high) in zip(joint.angle_axes, joint.limits, strict=True):
            spans["xyz".index(axis)] = max(0.25 * (high - low), 0.05)
    elif joint.limits:
        spans[:] = max(0.25 * float(np.mean([high - low for low, high in joint.limits])), 0.05)
    return spans
