"""Poses that this body has been seen in, and what they say of a limb that nothing sees.

A limb without a camera that sees is held by its joint alone: it spins, or hangs where it was last seen. People move
their limbs together, so the memory keeps the mean and the covariance of all joint rotations that were observed. Given
the joints that are seen, a Gaussian tells the others: their expectation and how far from it they have been.
"""

from collections.abc import Collection
from copy import copy
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.geometry import exp_so3, log_so3
from bodycam_ros.kinematics.joint import Joint, hinge_angle
from bodycam_ros.kinematics.limits import JointLimits
from bodycam_ros.settings import setting
from bodycam_ros.solving.expected_joints import ExpectedJoints


@dataclass(frozen=True)
class PoseMemorySettings:
    """How strongly and how long the seen poses hold a limb that is not seen."""

    sigma: float = setting(
        0.35,
        unit="rad",
        limits=(0.05, 10.0),
        reason="spread of a joint about the N-pose that is assumed until it has been seen, where no range is known",
    )
    min_sigma: float = setting(
        0.1, unit="rad", limits=(0.01, 3.0), reason="an unseen joint is never known better than this"
    )
    noise: float = setting(
        0.05, unit="rad", limits=(0.01, 1.0), reason="motion of the seen joints below this says nothing of the others"
    )
    forget_after: float = setting(
        60.0, unit="s", limits=(1.0, 3600.0), reason="people change what they do; older poses count less and less"
    )
    prior_time: float = setting(
        0.3,
        unit="s",
        limits=(0.0, 60.0),
        reason="for this long a joint must be seen to outweigh what was assumed of it",
    )
    correlation_time: float = setting(
        0.05,
        unit="s",
        limits=(0.001, 10.0),
        reason="how long a limb stays on one side of its expectation: the frames of this time are one opinion",
    )
    turning_time: float = setting(
        3.0,
        unit="s",
        limits=(0.001, 100.0),
        reason="the same for a limb whose rotation is measured from image to image: it knows where it is for longer",
    )
    lead_time: float = setting(
        0.2,
        unit="s",
        limits=(0.001, 10.0),
        reason="unseen for this long, a limb moves with its expectation and no longer as it moved when it was seen",
    )


class PoseMemory:
    """A Gaussian over all joint rotations, learned while they are observed.

    The rotation of each joint is a rotation vector (3) from the middle of its limits, so that an arm that is raised
    overhead is nowhere near the vector's jump at half a turn.

    Args:
        body: joints and their limits.
        settings: strength and time.
        machine: names of joints that are no person's: what they do tells of the others, and nothing tells of them.
    """

    def __init__(
        self, body: BodyModel, settings: PoseMemorySettings, machine: Collection[str] = frozenset[str]()
    ) -> None:
        self._settings = settings
        self._machine = np.array([joint.name in machine for joint in body.tree_joints], bool)
        self.machine_is_known = False
        self._turning_rows = [
            row for row, joint in enumerate(body.tree_joints) if self._machine[row] and joint.type == "hinge"
        ]
        self._axes = [body.tree_joints[row].axis for row in self._turning_rows]
        self._limits = JointLimits(body)
        self._middle_R = self._limits.middle()
        self._rest = log_so3(np.swapaxes(self._middle_R, -1, -2)).ravel()
        spans = np.array([_spans(joint, settings.sigma) for joint in body.tree_joints]).reshape(-1, 3)
        spans[self._machine] = 1.0
        self._rest_variance = np.ravel(spans**2)
        size = 3 * len(body.tree_joints)
        # Sums over the instants at which both of two components were seen: seconds, first component, product.
        self._unseen_s = np.zeros(len(body.tree_joints))
        self._expected_before = np.full((len(body.tree_joints), 3, 3), np.nan)
        self._seconds = np.zeros((size, size))
        self._sums = np.zeros((size, size))
        self._products = np.zeros((size, size))
        self._learned: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None

    @property
    def turning_time(self) -> float:
        """How long [s] a limb whose turns are measured knows by itself where it is."""
        return self._settings.turning_time

    @property
    def middle_of_limits(self) -> NDArray[np.float64]:
        """(J, 3, 3) joint rotations in the middle of their limits."""
        return self._middle_R

    @property
    def machine(self) -> NDArray[np.bool_]:
        """(J,) which joints are no person's; where they stand is always known well enough to tell of the others."""
        return self._machine

    @property
    def ever_seen(self) -> NDArray[np.bool_]:
        """(J,) which joints have been seen so far."""
        return np.asarray(np.diag(self._seconds)[::3] > 0.0)

    @property
    def forget_after(self) -> float:
        """How long [s] a pose is remembered."""
        return self._settings.forget_after

    @property
    def noise(self) -> float:
        """Motion [rad] that says nothing of other joints."""
        return self._settings.noise

    def asked_again(self) -> "PoseMemory":
        """The same memory at the beginning of a recording that it has seen: it is asked, and learns nothing more."""
        again = copy(self)
        again._unseen_s = np.zeros_like(self._unseen_s)
        again._expected_before = np.full_like(self._expected_before, np.nan)
        return again

    def remember(self, rotations: NDArray[np.float64], seen: NDArray[np.bool_], dt_s: float) -> None:
        """Learn joint rotations (J, 3, 3) of which some (J,) were seen, and that lasted for ``dt_s``."""
        self._learned = None
        seen = seen | (self._machine & self.machine_is_known)
        kept = np.exp(-dt_s / self._settings.forget_after)
        self._limits = self._limits.widened(rotations, seen)
        x = self.vectors(rotations)
        mask = np.repeat(seen, 3).astype(float)
        both = dt_s * np.outer(mask, mask)
        self._seconds = kept * self._seconds + both
        self._sums = kept * self._sums + both * x[:, None]
        self._products = kept * self._products + both * np.outer(x, x)

    def expect(
        self, rotations: NDArray[np.float64], seen: NDArray[np.bool_], turning: NDArray[np.bool_], dt_s: float
    ) -> ExpectedJoints:
        """What the joints that are seen say of the others: the Gaussian's conditional.

        A limb deviates from its expectation for a while, so an instant is only a share of an opinion; and in a blink
        the limb's own motion knows better.

        Args:
            rotations: (J, 3, 3) joint rotations; those of unseen joints do not matter.
            seen: (J,) whether both of a joint's segments are.
            turning: (J,) whether the rotation of what is not seen is measured at least.
            dt_s: since the instant before [s].
        """
        seen = seen | (self._machine & self.machine_is_known)
        self._unseen_s = np.where(seen, 0.0, self._unseen_s + dt_s)
        rows = np.flatnonzero(~seen & ~self._machine)
        if len(rows) == 0:
            self._expected_before[:] = np.nan
            return ExpectedJoints(rows, np.zeros((0, 3, 3)), np.zeros((0, 3)), np.zeros((0, 3, 3)), np.zeros(0))
        self._learned = self._learned or self._gaussian()
        mean, covariance = self._learned
        known, wanted = np.repeat(seen, 3), np.repeat(~seen & ~self._machine, 3)
        noise = self._settings.noise**2
        gain = np.linalg.solve(
            covariance[np.ix_(known, known)] + noise * np.eye(int(known.sum())), covariance[np.ix_(known, wanted)]
        ).T
        spread = covariance[np.ix_(wanted, wanted)] - gain @ covariance[np.ix_(known, wanted)]
        # A pose unlike all that were seen must not throw the others farther than they have ever been.
        reach = 2.0 * np.sqrt(np.diag(covariance)[wanted])
        deviation = gain @ (self.vectors(rotations) - mean)[known]
        expected = mean.copy()
        expected[wanted] += np.clip(deviation, -reach, reach)
        variances = np.diag(spread).reshape(-1, 3)
        caution = self._caution(turning, dt_s)[rows, None]
        sigmas = np.sqrt(np.maximum(variances, self._settings.min_sigma**2)) * caution
        now = self.within_limits(self._rotations(expected))[rows]
        steps = np.swapaxes(self._expected_before[rows], -1, -2) @ now
        steps[np.isnan(steps).any(axis=(1, 2))] = np.eye(3)
        self._expected_before[:] = np.nan
        self._expected_before[rows] = now
        lead = np.where(turning, 0.0, np.minimum(1.0, self._unseen_s / self._settings.lead_time))[rows]
        return ExpectedJoints(rows, now, sigmas, steps, lead)

    def _caution(self, turning: NDArray[np.bool_], dt_s: float) -> NDArray[np.float64]:
        """By how much (J,) an instant's sigma exceeds that of one opinion."""
        lasting_s = np.where(turning, self._settings.turning_time, self._settings.correlation_time)
        opinions = np.maximum(1.0, lasting_s / max(dt_s, 1e-3))
        blink: NDArray[np.float64] = 1.0 + (self._settings.correlation_time / np.maximum(self._unseen_s, 1e-3))
        return np.sqrt(opinions) * blink

    def within_limits(self, rotations: NDArray[np.float64]) -> NDArray[np.float64]:
        """Joint rotations (J, 3, 3) with every angle put back into its limits, or as far as it has been seen."""
        return self._limits.clamp(rotations)

    def _gaussian(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Mean (3J) and covariance (3J, 3J) of what was seen, begun with what is assumed."""
        prior_s = self._settings.prior_time + 1e-9
        alone_s = np.diag(self._seconds)
        mean = (np.diag(self._sums) + prior_s * self._rest) / (alone_s + prior_s)
        # About the mean: sum of (x - m)(y - n) over the instants that saw both.
        cross = self._products - self._sums * mean - (self._sums * mean).T + self._seconds * np.outer(mean, mean)
        covariance = cross / (self._seconds + prior_s)
        covariance[np.diag_indices_from(covariance)] += prior_s * self._rest_variance / (alone_s + prior_s)
        # Pairs that were seen at different times do not make one covariance by themselves.
        values, vectors = np.linalg.eigh(covariance)
        return mean, (vectors * np.maximum(values, 0.0)) @ vectors.T

    def vectors(self, rotations: NDArray[np.float64]) -> NDArray[np.float64]:
        """Rotation vectors (3 J) of joint rotations (J, 3, 3), from the middle of each joint's limits."""
        vectors = log_so3(np.swapaxes(self._middle_R, -1, -2) @ rotations)
        if self._machine.any():
            # A crank turns for ever, and legs follow it: sine and cosine instead of an angle that jumps.
            vectors[self._machine] = 0.0
            for row, axis in zip(self._turning_rows, self._axes, strict=True):
                angle = hinge_angle(rotations[row], axis)
                vectors[row, :2] = np.cos(angle), np.sin(angle)
        return vectors.ravel()

    def rotation(self, row: int, vector: NDArray[np.float64]) -> NDArray[np.float64]:
        """The rotation (3, 3) of one joint of the tree, of its vector (3,)."""
        R: NDArray[np.float64] = self._middle_R[row] @ exp_so3(vector)
        return R

    def _rotations(self, vectors: NDArray[np.float64]) -> NDArray[np.float64]:
        rotations: NDArray[np.float64] = self._middle_R @ exp_so3(vectors.reshape(-1, 3))
        return rotations


def _spans(joint: Joint, unknown: float) -> NDArray[np.float64]:
    """Spread of a joint about its x, y and z [rad] as its range tells: people are within a quarter of it mostly."""
    spans = np.full(3, unknown)
    if joint.limits and joint.type == "ball":
        for axis, (low, high) in zip(joint.angle_axes, joint.limits, strict=True):
            spans["xyz".index(axis)] = max(0.25 * (high - low), 0.05)
    elif joint.limits:
        spans[:] = max(0.25 * float(np.mean([high - low for low, high in joint.limits])), 0.05)
    return spans
