"""Poses and unknown lengths of the equipment from the body's points that are attached to it (B eq. 15).

The body is given; only the equipment moves, as a chain of twists from its root (B eq. 3-4). So a wrong attachment shows
as a distance before it could bend the body. What lasts, the lengths and the pose of a root that stands, is estimated
from time to time: a fit has the information of all before it as a prior.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.equipment import Attachment, Equipment, UnknownLengths
from bodycam_ros.estimation.equipment_chain import EquipmentChain
from bodycam_ros.geometry import Array, hat, inverse, log_se3
from bodycam_ros.kinematics.joint import Joint
from bodycam_ros.least_squares import damped_gauss_newton

AttachedPoints = Mapping[str, Array]
"""Attachment -> (N, 3) its points on the body, in the world [m]; NaN where it is not active, or not observed."""

BODY_M = 0.003  # sigma of an observed segment; no pair of points weighs more
_KERNEL = 10.0  # sigmas at which an attachment counts half (Cauchy): a prediction may be as far off
_STEPS, _LONGEST_STEP, _CONVERGED = 30, 1.0, 1e-6  # at most; [rad], [m]; relative decrease of the cost
_STIFFENING = 1e-6  # added to information, so that it has an inverse


def attached(points: AttachedPoints) -> list[str]:
    """Names of the attachments whose points are known."""
    return [name for name, each in points.items() if np.isfinite(each).all()]


@dataclass(frozen=True, eq=False)
class LastingEquipment:
    """What is known of the equipment from all times: a Gaussian.

    Attributes:
        world_T_root: (4, 4) of a root that stands.
        lengths: (L) deviation of the unknown lengths from the file [m].
        information: (6 + L, 6 + L) of a tangent of the root, zero of one that moves, then of the lengths.
    """

    world_T_root: Array
    lengths: Array
    information: Array

    def without_root(self) -> "LastingEquipment":
        """The same, but the root may be anywhere."""
        information = self.information.copy()
        information[:6], information[:, :6] = 0.0, 0.0
        return replace(self, information=information)


@dataclass(frozen=True, eq=False)
class FittedEquipment:
    """The outcome of a fit.

    Attributes:
        poses: (E, 4, 4) world_T_segment, in the order of ``Equipment.segments``.
        lasting: as known with this time.
        cost: robust sum of squares, in sigmas.
        root_sigmas: (6) of the root's pose [rad], [m].
        length_sigmas: (L) [m].
    """

    poses: Array
    lasting: LastingEquipment
    cost: float
    root_sigmas: Array
    length_sigmas: Array


class _Unknowns(NamedTuple):
    root: Array
    motions: Array
    lengths: Array


class EquipmentFit:
    """Fits the equipment's segments, and its unknown lengths, to the body.

    Args:
        equipment: its joints, attachments and how upright it is.
        tree: its own joints, parents first.

    Attributes:
        lengths: what is unknown.
        chain: its segments as functions of root, joints and lengths.
    """

    def __init__(self, equipment: Equipment, tree: Sequence[Joint]) -> None:
        self._equipment, self._stands = equipment, equipment.segments[equipment.root].stands
        self.lengths = UnknownLengths(equipment, tree)
        self.chain = EquipmentChain(equipment, tree, self.lengths)
        self._lasting = np.concatenate([np.arange(6), self.chain.length_columns])

    def unknown(self) -> LastingEquipment:
        """What is known before any fit: the lengths as the file has them."""
        information = np.diag(np.concatenate([np.zeros(6), self.lengths.priors**-2.0]))
        return LastingEquipment(np.eye(4), np.zeros(len(self.lengths)), information)

    def solve(
        self,
        start: Array,
        points: AttachedPoints,
        known: LastingEquipment,
        root: tuple[Array, Array] | None = None,
    ) -> FittedEquipment:
        """Fit the equipment at one time.

        Args:
            start: (E, 4, 4) initial poses.
            points: measured.
            known: of other times.
            root: measured pose (4, 4) of the root and its sigmas (6) [rad], [m].
        """
        motions = self.chain.motions(start, known.lengths)
        initial = _Unknowns(start[self.chain.root], motions, known.lengths)
        stiff = known.information + _STIFFENING * np.eye(len(self._lasting))
        weights = np.asarray(np.linalg.cholesky(stiff).T, np.float64)

        def linearise(at: _Unknowns) -> tuple[Array, Array, float]:
            return self._linearise(at, points, known, weights, root)

        def moved(at: _Unknowns, step: Array) -> _Unknowns:
            return _Unknowns(*self.chain.moved(at.root, at.motions, step), at.lengths + step[self.chain.length_columns])

        fitted, cost = damped_gauss_newton(initial, linearise, moved, _STEPS, _LONGEST_STEP, _CONVERGED)
        J = linearise(fitted)[1]
        covariance = np.linalg.inv(J.T @ J + _STIFFENING * np.eye(self.chain.count))
        sigmas = np.sqrt(np.diag(covariance))
        information, first = np.zeros_like(known.information), 0 if self._stands else 6
        lasting = self._lasting[first:]
        information[first:, first:] = np.linalg.inv(covariance[np.ix_(lasting, lasting)])
        return FittedEquipment(
            self.chain.poses(*fitted)[0],
            LastingEquipment(fitted.root, fitted.lengths, information),
            cost,
            sigmas[:6],
            sigmas[self.chain.length_columns],
        )

    def _linearise(
        self,
        at: _Unknowns,
        points: AttachedPoints,
        known: LastingEquipment,
        weights: Array,
        measured: tuple[Array, Array] | None,
    ) -> tuple[Array, Array, float]:
        """Residuals (R) in sigmas, their Jacobian (R, n), and the robust cost."""
        poses, moves = self.chain.poses(*at)
        residuals, jacobians, cost = [], [], 0.0

        def add(r: Array, columns: NDArray[np.intp] | slice, J: Array) -> None:
            nonlocal cost
            block = np.zeros((len(r), self.chain.count))
            block[:, columns] = J
            residuals.append(r)
            jacobians.append(block)
            cost += float(r @ r)

        for attachment in self._equipment.attachments:
            if np.isfinite(points[attachment.name]).all():
                r, J = self._pairs(attachment, poses, moves, at.lengths, points[attachment.name])
                count = len(attachment.sigmas)
                squared = float(r @ r) / count / _KERNEL**2
                weight = 1.0 / np.sqrt(1.0 + squared)
                add(weight * r, slice(None), weight * J)
                cost += count * _KERNEL**2 * (np.log1p(squared) - squared / (1.0 + squared))
        if np.isfinite(sigma := self._equipment.upright_sigma):
            up = at.root[2, :3]
            add(up[:2] / sigma, slice(0, 3), hat(up)[:2] / sigma)
        for row, sigmas in enumerate(self.chain.sigmas):
            soft = np.isfinite(sigmas)
            off = (log_se3(at.motions[row]) @ self.chain.twists[row])[soft] / sigmas[soft]
            columns = np.arange(*self.chain.columns[row].indices(self.chain.count))[soft]
            add(off, columns, np.diag(1.0 / sigmas[soft]))
        if measured is not None:
            add(log_se3(inverse(measured[0]) @ at.root) / measured[1], slice(0, 6), np.diag(1.0 / measured[1]))
        away = np.concatenate([log_se3(inverse(known.world_T_root) @ at.root), at.lengths - known.lengths])
        add(weights @ away, self._lasting, weights)
        return np.concatenate(residuals), np.concatenate(jacobians), cost

    def _pairs(
        self, attachment: Attachment, poses: Array, moves: Array, lengths: Array, on_body: Array
    ) -> tuple[Array, Array]:
        """Residuals (3N) of an attachment's pairs in its equipment segment's axes, in sigmas, and Jacobian (3N, n)."""
        row = self.chain.row[attachment.equipment_segment]
        measured = (on_body - poses[row, :3, 3]) @ poses[row, :3, :3]
        off = measured - self.lengths.attachment(attachment, lengths).on_equipment
        by_segment = np.concatenate([hat(measured), np.broadcast_to(-np.eye(3), (len(measured), 3, 3))], axis=2)
        J = by_segment @ moves[row]
        for column, axis in self.lengths.columns(attachment.name):
            J[:, axis, self.chain.length_columns[column]] -= 1.0
        sigmas = np.hypot(attachment.sigmas, BODY_M)[:, None]
        return (off / sigmas).ravel(), (J / sigmas[..., None]).reshape(-1, self.chain.count)
