"""The pose prior: what the joints that are seen tell of a limb that nothing sees.

A limb without a camera that sees is held by its joint alone. People move their limbs together, so the prior is the mean
and the covariance of all joint rotations that were observed of this body so far. Given the joints that are seen, a
Gaussian tells the others: their expectation and how far from it they have been.

The memory of the forward pass (``PosePrior``) is a Gaussian of what was seen until then, and of joints that were
seldom seen together it knows too little. Here each unseen joint is a linear function of what is seen with it: of the
seen joints' rotations, and of how fast they turn, which tells the phases of a step apart. It is fitted to the instants
before and after at which the joint was seen, the near ones first.
"""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.estimation.measurements import JointRotations
from bodycam_ros.geometry import Array, exp_so3, log_so3
from bodycam_ros.kinematics.joint import Joint, hinge_angle
from bodycam_ros.kinematics.joint_angles import JointLimits

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


_TURN_S = 0.1  # [s] before and after, between which a turn is a velocity, and by which it counts like an angle
_POSE_LASTS_S = 0.5  # for which a joint stays beside where it is told to be
_LEAST_S = 0.5  # [s] of a joint that was seen for less the forward pass's memory knows more
_FADES_S = 2.0  # by which poses farther in time tell less: people do now as they did a moment ago
_MOSTLY = 0.5  # share of those instants at which what tells it must have been seen


@dataclass(frozen=True, eq=False)
class _Instants:
    """Features (T, F) of instants, whether each is known (T, F), and the stamps (T,) [ns]."""

    stamps_ns: NDArray[np.int64]
    features: Array
    known: Mask

    def followed_by(self, others: "_Instants") -> "_Instants":
        return _Instants(
            np.concatenate([self.stamps_ns, others.stamps_ns]),
            np.concatenate([self.features, others.features]),
            np.concatenate([self.known, others.known]),
        )

    def only(self, which: slice | Mask) -> "_Instants":
        return _Instants(self.stamps_ns[which], self.features[which], self.known[which])


class RecordedPoses:
    """Remembers the instants of a recording, and those of the last minute before them.

    Args:
        memory: of the forward pass: how joint rotations become vectors, and how old poses may be.
    """

    def __init__(self, memory: PosePrior) -> None:
        self._memory = memory
        self._earlier: _Instants | None = None
        self._asked: _Instants | None = None
        self._known: _Instants | None = None
        self._fits: dict[tuple[int, int, bytes], _Fit | None] = {}

    def expect(
        self, stamps_ns: NDArray[np.int64], rotations: Array, seen: Mask, expected: Sequence[JointRotations]
    ) -> list[JointRotations]:
        """Expectations of T instants, better than those of the forward pass where enough was seen.

        Args:
            stamps_ns: (T,) [ns].
            rotations: (T, J, 3, 3) joint rotations; of unseen joints as far as they are known.
            seen: (T, J) whether both of a joint's segments were.
            expected: (T) by the forward pass's memory.
        """
        self._asked = self._instants(stamps_ns, rotations, seen)
        if self._earlier:
            ago_ns = stamps_ns[0] - self._earlier.stamps_ns
            self._earlier = self._earlier.only((ago_ns > 0) & (ago_ns < 1e9 * FORGET_S))
        self._known = self._earlier.followed_by(self._asked) if self._earlier else self._asked
        better = [each.rotations.copy() for each in expected]
        for row in np.flatnonzero(~seen.all(axis=0)).tolist():
            unseen = np.flatnonzero(~seen[:, row])
            for stretch in np.split(unseen, np.flatnonzero(np.diff(unseen) > 1) + 1):
                for place, vector in self._bridged(self._asked, row, stretch.tolist()):
                    better[place][expected[place].rows == row] = self._memory.rotation(row, vector)
        self._fits.clear()
        within = [self._within_limits(*each) for each in zip(rotations, expected, better, strict=True)]
        return [replace(each, rotations=told) for each, told in zip(expected, within, strict=True)]

    def keep(self, count: int) -> None:
        """The first ``count`` of the instants that were asked for are over; they are remembered for a while."""
        if self._asked is None:
            return
        over = self._asked.only(slice(count))
        self._earlier = self._earlier.followed_by(over) if self._earlier else over

    def _instants(self, stamps_ns: NDArray[np.int64], rotations: Array, seen: Mask) -> _Instants:
        """Rotation vectors of all joints (3 J), then their velocities (3 J), where they are known."""
        vectors = np.array([self._memory.vectors(each) for each in rotations])
        each = np.arange(len(stamps_ns))
        before = np.searchsorted(stamps_ns, stamps_ns - 1e9 * _TURN_S)
        after = np.searchsorted(stamps_ns, stamps_ns + 1e9 * _TURN_S, side="right") - 1
        passed_s = np.maximum(1e-9 * (stamps_ns[after] - stamps_ns[before]), 1e-3)
        speeds = (vectors[after] - vectors[before]) * (_TURN_S / passed_s)[:, None]
        lasting = seen[before] & seen[each] & seen[after] & (after > before)[:, None]
        known = np.repeat(np.concatenate([seen, lasting], axis=1), 3, axis=1)
        return _Instants(stamps_ns, np.concatenate([vectors, speeds], axis=1), known)

    def _bridged(self, asked: _Instants, row: int, stretch: Sequence[int]) -> Iterator[tuple[int, Array]]:
        """Instants of a stretch at which a joint is unseen, and its vector (3,), where enough is known to tell it.

        At the ends, where it is seen, the joint is not quite where it was told to be. It stays so for a while.
        """
        middle_ns = int(asked.stamps_ns[[stretch[0], stretch[-1]]].mean())
        told = [(place, self._fit(asked, row, place, middle_ns)) for place in stretch]
        ends = [
            (end, asked.features[end, 3 * row : 3 * row + 3] - of_end)
            for end, (_, fit) in ((stretch[0] - 1, told[0]), (stretch[-1] + 1, told[-1]))
            if 0 <= end < len(asked.stamps_ns) and fit is not None and (of_end := fit.at(asked, end)) is not None
        ]
        ends_s = 1e-9 * asked.stamps_ns[[end for end, _ in ends]].astype(np.float64)
        deviations = np.array([deviation for _, deviation in ends]).reshape(-1, 3)
        shared = np.linalg.solve(_alike(ends_s, ends_s) + 1e-9 * np.eye(len(ends)), deviations)
        for place, fit in told:
            vector = fit.at(asked, place) if fit is not None else None
            if vector is not None:
                now_s = 1e-9 * asked.stamps_ns[place : place + 1].astype(np.float64)
                yield place, vector + (_alike(now_s, ends_s) @ shared)[0]

    def _fit(self, asked: _Instants, row: int, place: int, middle_ns: int) -> "_Fit | None":
        """How a joint follows from what is seen at an instant, about the middle of a stretch of them."""
        told = asked.known[place]
        key = (row, middle_ns, told.tobytes())
        if key not in self._fits:
            self._fits[key] = self._fitted(told, row, middle_ns)
        return self._fits[key]

    def _fitted(self, told: Mask, row: int, middle_ns: int) -> "_Fit | None":
        """What tells a joint, fitted to all instants at which it was seen; None if it seldom was.

        What tells it was not seen at all of them; there it is where the forward pass has it.
        """
        known = self._known
        if known is None or len(known.stamps_ns) < 2:
            return None
        wanted = slice(3 * row, 3 * row + 3)
        seen = known.known[:, wanted].all(axis=1)
        if seen.sum() * np.median(np.diff(known.stamps_ns)) < 1e9 * _LEAST_S:
            return None
        told = told & (known.known[seen].mean(axis=0) >= _MOSTLY)
        if not told.any():
            return None
        X, Y = known.features[seen][:, told], known.features[seen, wanted]
        away_s = 1e-9 * np.abs(known.stamps_ns[seen] - middle_ns).astype(np.float64)
        share = np.exp(-away_s / _FADES_S)
        share /= share.sum()
        x_mean, y_mean = share @ X, share @ Y
        A = X - x_mean
        noise = self._memory.noise_rad**2 * np.eye(A.shape[1])
        weights = np.linalg.solve(A.T @ (share[:, None] * A) + noise, A.T @ (share[:, None] * (Y - y_mean)))
        return _Fit(told, np.asarray(weights, np.float64), np.asarray(y_mean - x_mean @ weights, np.float64))

    def _within_limits(self, rotations: Array, expected: JointRotations, told: Array) -> Array:
        """Rotations (U, 3, 3) of the unseen joints, as far as joints turn."""
        every = rotations.copy()
        every[expected.rows] = told
        return self._memory.limits.clamp(every)[expected.rows]


@dataclass(frozen=True, eq=False)
class _Fit:
    """Features that tell a joint's vector (3,): which (F,) of them, their weights and what is added to them."""

    told: Mask
    weights: Array
    offset: Array

    def at(self, instants: _Instants, place: int) -> Array | None:
        """The vector (3,) at an instant; None if not all of the features are known there."""
        if not instants.known[place, self.told].all():
            return None
        return np.asarray(self.offset + instants.features[place, self.told] @ self.weights)


def _alike(some_s: Array, others_s: Array) -> Array:
    """How alike (N, M) deviations at two times [s] are."""
    return np.asarray(np.exp(-np.abs(some_s[:, None] - others_s) / _POSE_LASTS_S))
