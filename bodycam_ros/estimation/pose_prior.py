"""The pose prior: the rotations of unobserved joints.

Forwards a joint is expected where it was while it was observed, with the spread that it had then (``PosePrior``).

Over a whole recording an unobserved joint is a linear function of the rotations and velocities of the observed joints,
by which the phases of a step differ: people move their limbs together. It is fitted to the states before and after in
which the joint was observed, the near ones first (``RecordedPoses``).
"""

from collections.abc import Collection, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.estimation.coordinates import FREE_RAD
from bodycam_ros.estimation.factors.joint_rotations import JointRotations
from bodycam_ros.estimation.factors.motion import FADE_S
from bodycam_ros.geometry import Array, exp_so3, log_so3
from bodycam_ros.kinematics.joint import Joint
from bodycam_ros.kinematics.joint_angles import JointLimits

Mask = NDArray[np.bool_]

_NOISE_RAD = 0.05  # smaller motion of the observed joints carries no information on the others
_LEAST_RAD = 0.07  # least sigma of a predicted joint
_TURNING_LASTS_S = 3.0  # a limb whose rotation between frames is measured stays on one side of its prediction so long
FORGET_S = 60.0  # people change what they do: older poses count less
_TURN_S = 0.1  # before and after, between which velocities are taken, and by which they count like an angle
_LEAST_S = 0.5  # of a joint that was observed for less, a whole recording has no more than the forward pass
_FADES_S = 2.0  # by which states farther in time count less: people do now as they did a moment ago
_LEAST_SHARE = 0.25  # of a joint's usual variance that remains where others predict it: few poses repeat exactly
_MOSTLY = 0.5  # share of those states, and of a gap's, in which a feature must have been observed


class PosePrior:
    """Mean and spread of all joint rotations, estimated while they are observed.

    The rotation of each joint is a rotation vector (3) from the middle of its limits, so that an arm that is raised
    overhead is nowhere near the vector's jump at half a turn.

    Args:
        body: joints and their limits.
        excluded: names of joints that are no person's.
        known: what ``joint_sums`` found of the recording, which nothing is added to; None to estimate while solving.
    """

    def __init__(
        self,
        body: BodyModel,
        excluded: Collection[str] = frozenset[str](),
        known: Mapping[str, Sequence[Sequence[float]]] | None = None,
    ) -> None:
        self._included = np.array([joint.name not in excluded for joint in body.tree_joints], bool)
        self._middle_R = JointLimits(body).middle()
        # Seconds, vectors and their squares, summed over the states in which each component was observed; at first
        # what is assumed, which is not forgotten and counts like the time in which a velocity fades.
        rest = log_so3(np.swapaxes(self._middle_R, -1, -2)).ravel()
        spans = np.array([_spans(joint) for joint in body.tree_joints]).reshape(-1)
        self._assumed = FADE_S * np.stack([np.ones(len(rest)), rest, rest**2 + spans**2])
        self._joints, self._is_known = [joint.name for joint in body.tree_joints], known is not None
        self._sums = np.zeros_like(self._assumed)
        if known:
            self._sums = np.hstack([known.get(name, np.zeros((3, 3))) for name in self._joints])

    def joint_sums(self, rotations: Array, observed: Mask, dt_s: float) -> dict[str, Array]:
        """Joint -> (3, 3) seconds, rotation vectors [rad] and their squares, summed over T states of ``dt_s`` each.

        Args:
            rotations: (T, J, 3, 3) of all joints.
            observed: (T, J) whether both of a joint's segments were.
            dt_s: how long each state lasts [s].
        """
        x = self.vectors(rotations).reshape(*observed.shape, 3)
        sums = dt_s * np.einsum("tj,stji->jsi", observed, np.stack([np.ones_like(x), x, x**2]))
        return dict(zip(self._joints, sums, strict=True))

    def add(self, rotations: Array, observed: Mask, dt_s: float) -> None:
        """Add joint rotations (J, 3, 3), of which some (J,) were observed for ``dt_s``."""
        if self._is_known:
            return
        x, lasts_s = self.vectors(rotations), dt_s * np.repeat(observed & self._included, 3)
        self._sums = np.exp(-dt_s / FORGET_S) * self._sums + lasts_s * np.stack([np.ones(len(x)), x, x**2])

    def predict(self, observed: Mask, turning: Mask, dt_s: float) -> JointRotations:
        """The unobserved joints; none where no joint is observed.

        Args:
            observed: (J,) whether both of a joint's segments are.
            turning: (J,) whether their rotations between frames are measured at least.
            dt_s: how long the state lasts [s].
        """
        rows = np.flatnonzero(~observed & self._included)
        if len(rows) == 0 or not (observed & self._included).any():
            return JointRotations.nothing()
        mean, variances = (each.reshape(-1, 3)[rows] for each in self.moments())
        # States in which a limb stays on one side of its prediction are one measurement.
        shared = np.maximum(1.0, np.where(turning[rows], _TURNING_LASTS_S, FADE_S) / dt_s)[:, None]
        return JointRotations(rows, self.rotations(rows, mean), np.sqrt(variances * shared))

    def moments(self) -> tuple[Array, Array]:
        """Mean (3J) of the rotation vectors [rad], and their variances (3J) [rad^2], with what is assumed."""
        seconds, sums, squares = self._sums + self._assumed
        mean = sums / seconds
        return mean, np.maximum(squares / seconds - mean**2, _LEAST_RAD**2)

    def vectors(self, rotations: Array) -> Array:
        """Rotation vectors (..., 3 J) of joint rotations (..., J, 3, 3), from the middle of each joint's limits."""
        vectors: Array = log_so3(np.swapaxes(self._middle_R, -1, -2) @ rotations)
        return vectors.reshape(*vectors.shape[:-2], -1)

    def rotations(self, rows: NDArray[np.int64], vectors: Array) -> Array:
        """Joint rotations (U, 3, 3) of some joints, by their vectors (U, 3)."""
        rotations: Array = self._middle_R[rows] @ exp_so3(vectors)
        return rotations


def _spans(joint: Joint) -> Array:
    """Spread of a joint about its x, y and z [rad] by its range, if any: people are within a quarter of it mostly."""
    spans = np.full(3, FREE_RAD)
    if joint.limits and joint.type == "ball":
        for axis, (low, high) in zip(joint.angle_axes, joint.limits, strict=True):
            spans["xyz".index(axis)] = max(0.25 * (high - low), 0.05)
    elif joint.limits:
        spans[:] = max(0.25 * float(np.mean([high - low for low, high in joint.limits])), 0.05)
    return spans


class RecordedPoses:
    """Predicts unobserved joints from T states of a recording.

    Args:
        prior: of the forward pass, which has the rotation vectors.
        stamps_ns: (T,) [ns].
        rotations: (T, J, 3, 3) joint rotations; of unobserved joints as the forward pass has them.
        observed: (T, J) whether both of a joint's segments were.
    """

    def __init__(self, prior: PosePrior, stamps_ns: NDArray[np.int64], rotations: Array, observed: Mask) -> None:
        self._prior = prior
        self._observed = observed
        self._seconds = 1e-9 * (stamps_ns - stamps_ns[0])
        # Features: rotation vectors of all joints (3 J), then their velocities (3 J).
        vectors = prior.vectors(rotations)
        before = np.searchsorted(self._seconds, self._seconds - _TURN_S)
        after = np.searchsorted(self._seconds, self._seconds + _TURN_S, side="right") - 1
        passed_s = np.maximum(self._seconds[after] - self._seconds[before], 1e-3)
        velocities = (vectors[after] - vectors[before]) * (_TURN_S / passed_s)[:, None]
        moving = observed[before] & observed & observed[after] & (after > before)[:, None]
        self._features = np.concatenate([vectors, velocities], axis=1)
        self._known = np.repeat(np.concatenate([observed, moving], axis=1), 3, axis=1)

    def improve(self, predicted: Sequence[JointRotations]) -> list[JointRotations]:
        """Predictions of the last N states, better than those (N) of the forward pass where enough was observed."""
        first = len(self._observed) - len(predicted)
        better = [(each.rotations.copy(), each.sigmas.copy()) for each in predicted]
        usual = self._prior.moments()[1].reshape(-1, 3)
        for row in np.flatnonzero(~self._observed[first:].all(axis=0)).tolist():
            unobserved = first + np.flatnonzero(~self._observed[first:, row])
            for gap in np.split(unobserved, np.flatnonzero(np.diff(unobserved) > 1) + 1):
                regressed = self._regress(row, gap)
                if regressed is None:
                    continue
                vectors, variances = regressed
                shares = np.sqrt(np.clip(variances / usual[row], _LEAST_SHARE, 1.0))
                for place, vector in zip((gap - first).tolist(), vectors, strict=True):
                    own, (rotations, sigmas) = predicted[place].joints == row, better[place]
                    rotations[own] = self._prior.rotations(np.array([row]), vector[None])
                    sigmas[own] *= shares
        return [JointRotations(each.joints, *both) for each, both in zip(predicted, better, strict=True)]

    def _regress(self, row: int, gap: NDArray[np.intp]) -> tuple[Array, Array] | None:
        """A joint's vectors (G, 3) in the states of a gap by the features that are mostly known, and variances (3).

        States without some of the features count with the values of the forward pass. None of a joint that was seldom
        observed.
        """
        observed = self._observed[:, row]
        if observed.mean() * self._seconds[-1] < _LEAST_S:
            return None
        features = (self._known[gap].mean(axis=0) >= _MOSTLY) & (self._known[observed].mean(axis=0) >= _MOSTLY)
        X, Y = self._features[observed][:, features], self._features[observed, 3 * row : 3 * row + 3]
        share = np.exp(-np.abs(self._seconds[observed] - self._seconds[gap[[0, -1]]].mean()) / _FADES_S)
        share /= share.sum()
        x_mean, y_mean = share @ X, share @ Y
        A = X - x_mean
        noise = _NOISE_RAD**2 * np.eye(A.shape[1])
        weights = np.linalg.solve(A.T @ (share[:, None] * A) + noise, A.T @ (share[:, None] * (Y - y_mean)))
        variances = np.maximum(share @ (Y - y_mean - A @ weights) ** 2, _LEAST_RAD**2)
        return y_mean + (self._features[gap][:, features] - x_mean) @ weights, variances
