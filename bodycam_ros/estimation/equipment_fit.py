"""Where the equipment is, and what nobody measured of it, given where the body holds it (B eq. 15).

The body is taken as it is seen, at one instant or at many; only the equipment moves, as a chain of twists from its
root (B eq. 3-4). So the fit says how far each attachment is from holding without the body giving way: one that
contradicts the others is found here before it could bend anybody. Where it stands and what is unknown of it are the
same at all instants; a Schur complement eliminates the rest.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.equipment import Attachment, Equipment, UnknownLengths
from bodycam_ros.estimation.equipment_motion import EquipmentChain
from bodycam_ros.geometry import hat, inverse, log_se3
from bodycam_ros.kinematics.joint import Joint

Array = NDArray[np.float64]

BODY_M = 0.003
"""How well a seen segment is known; no pair of points weighs more."""

_KERNEL = 10.0
"""Sigmas at which an attachment counts half (Cauchy): a prediction may be so far off, what is let go is farther."""

_SETTLED = 1e-6
_STIFFENING = 1e-6


@dataclass(frozen=True, eq=False)
class HeldPoints:
    """Where the body holds the equipment at T instants.

    Attributes:
        points: attachment -> (T, N, 3) its points on the body, in the world [m].
        holds: attachment -> (T,) whether it holds, as far as is known.
    """

    points: Mapping[str, Array]
    holds: Mapping[str, NDArray[np.bool_]]


@dataclass(frozen=True, eq=False)
class Prior:
    """What is known of the equipment's segments beforehand, at one instant.

    Attributes:
        poses: (E, 4, 4) where they should be.
        sigmas: (E, 6) how far the root may be from there, and each other segment from there on its parent; rotation
            [rad], then translation [m].
    """

    poses: Array
    sigmas: Array


@dataclass(frozen=True, eq=False)
class FittedEquipment:
    """The outcome of a fit.

    Attributes:
        poses: (T, E, 4, 4) world_T_segment, in the order of ``Equipment.segments``.
        lengths: (L) how far what was unknown is from where it was said to be [m].
        cost: robust sum of squares, in sigmas.
        root_sigmas: (6) of the root's pose at the first instant [rad], [m].
        length_sigmas: (L) [m].
    """

    poses: Array
    lengths: Array
    cost: float
    root_sigmas: Array
    length_sigmas: Array


class EquipmentFit:
    """Fits the equipment's segments, and its unknown lengths, to the body.

    Args:
        equipment: its joints, attachments and how upright it is.
        tree: its own joints, parents first.

    Attributes:
        lengths: what is unknown.
        chain: how its segments follow from its root, joints and lengths.
        row: segment -> its row among the equipment's.
    """

    def __init__(self, equipment: Equipment, tree: Sequence[Joint]) -> None:
        self._equipment = equipment
        self.lengths = UnknownLengths(equipment, tree)
        self.chain = EquipmentChain(equipment, tree, self.lengths)
        self.row = self.chain.row
        lasting = 6 if equipment.segments[equipment.root].stands else 0
        self._lasting = np.concatenate([np.arange(lasting), self.chain.length_columns]).astype(np.intp)
        self._moving = np.setdiff1d(np.arange(self.chain.count), self._lasting)

    def solve(
        self, start: Array, lengths: Array, held: HeldPoints, prior: Prior | None = None, steps: int = 30
    ) -> FittedEquipment:
        """Gauss-Newton with damping.

        Args:
            start: (T, E, 4, 4) poses to begin at; a root that stands is where it is at the last of them.
            lengths: (L) to begin at [m].
            held: where the body holds it.
            prior: of the segments, at one instant only.
            steps: at most.
        """
        root, motions = start[:, self.chain.root], self.chain.motions(start, lengths)
        if 0 in self._lasting:
            root = np.broadcast_to(root[-1], root.shape)
        expected = None if prior is None else (prior, self.chain.motions(prior.poses[None], lengths))
        damping = 0.1
        H, g, cost = self._normal_equations(root, motions, lengths, held, expected)
        for _ in range(steps):
            step = self._step(H, g, damping)
            new_root, moved = self.chain.moved(root, motions, step)
            longer = lengths + step[0, self.chain.length_columns]
            H_new, g_new, cost_new = self._normal_equations(new_root, moved, longer, held, expected)
            if not cost_new <= cost:
                damping *= 10.0
                continue
            settled = cost - cost_new < _SETTLED * (1.0 + cost)
            root, motions, lengths = new_root, moved, longer
            H, g, cost, damping = H_new, g_new, cost_new, 0.2 * damping
            if settled:
                break
        sigmas = self._sigmas(H, g)
        poses = self.chain.poses(root, motions, lengths)[0]
        return FittedEquipment(poses, lengths, cost, sigmas[:6], sigmas[self.chain.length_columns])

    def _normal_equations(
        self,
        root: Array,
        motions: Array,
        lengths: Array,
        held: HeldPoints,
        expected: tuple[Prior, Array] | None,
    ) -> tuple[Array, Array, float]:
        """Hessians (T, n, n), gradients (T, n) and the robust cost."""
        poses, moves = self.chain.poses(root, motions, lengths)
        H, g, cost = (
            np.zeros((len(root), self.chain.count, self.chain.count)),
            np.zeros((len(root), self.chain.count)),
            0.0,
        )

        def add(J: Array, r: Array, weights: Array | float = 1.0) -> None:
            nonlocal H, g
            weighted = np.swapaxes(J, 1, 2) * np.reshape(weights, (-1, 1, 1))
            H, g = H + weighted @ J, g + (weighted @ r[..., None])[..., 0]

        for attachment in self._equipment.attachments:
            holds = held.holds[attachment.name]
            if holds.any():
                J, r = self._pairs(attachment, poses, moves, lengths, held.points[attachment.name])
                squared = np.sum(r**2, axis=1) / len(attachment.sigmas) / _KERNEL**2
                add(J, r, holds / (1.0 + squared))
                cost += len(attachment.sigmas) * _KERNEL**2 * float(np.sum(np.log1p(squared)[holds]))
        if np.isfinite(self._equipment.upright_sigma):
            up = root[:, 2, :3]
            J = np.zeros((len(root), 2, self.chain.count))
            J[:, :, :3] = hat(up)[:, :2] / self._equipment.upright_sigma
            r = up[:, :2] / self._equipment.upright_sigma
            add(J, r)
            cost += float(np.sum(r**2))
        cost += self._add_joints(H, g, motions)
        # What lasts is known once, not at every instant.
        columns = self.chain.length_columns
        H[0, columns, columns] += 1.0 / self.lengths.priors**2
        g[0, columns] += lengths / self.lengths.priors**2
        cost += float(np.sum((lengths / self.lengths.priors) ** 2))
        if expected is not None:
            cost += self._add_prior(H, g, root, motions, expected)
        return H, g, cost

    def _add_joints(self, H: Array, g: Array, motions: Array) -> float:
        """What joints say that are neither free nor held."""
        cost = 0.0
        for row, f in enumerate(self.chain.freedoms):
            if np.isfinite(f.sigmas).any():
                weights = np.where(np.isfinite(f.sigmas), 1.0 / f.sigmas**2, 0.0)
                off = log_se3(motions[:, row]) @ f.twists
                _diagonal(H, f.columns)[...] += weights
                g[:, f.columns] += weights * off
                cost += float(np.sum(weights * off**2))
        return cost

    def _add_prior(self, H: Array, g: Array, root: Array, motions: Array, expected: tuple[Prior, Array]) -> float:
        prior, expected_motions = expected

        def add(columns: slice, off: Array, sigmas: Array) -> float:
            _diagonal(H, columns)[...] += 1.0 / sigmas**2
            g[:, columns] += off / sigmas**2
            return float(np.sum((off / sigmas) ** 2))

        off = log_se3(inverse(prior.poses[self.chain.root]) @ root)
        cost = add(slice(0, 6), off, prior.sigmas[self.chain.root])
        away = log_se3(inverse(expected_motions) @ motions)
        for row, f in enumerate(self.chain.freedoms):
            sigmas = np.abs(f.twists).T @ prior.sigmas[self.row[f.joint.child]]
            cost += add(f.columns, away[:, row] @ f.twists, sigmas)
        return cost

    def _pairs(
        self, attachment: Attachment, poses: Array, moves: Array, lengths: Array, held: Array
    ) -> tuple[Array, Array]:
        """Jacobians (T, 3N, n) and residuals (T, 3N) of an attachment's pairs, in its equipment segment's axes."""
        row = self.row[attachment.equipment_segment]
        pose = poses[:, row]
        seen = (held - pose[:, None, :3, 3]) @ pose[:, :3, :3]
        off = seen - self.lengths.attachment(attachment, lengths).on_equipment
        of_segment = np.concatenate([hat(seen), np.broadcast_to(-np.eye(3), (*seen.shape, 3))], axis=3)
        J = of_segment @ moves[:, None, row]
        for column, axis in self.lengths.of(attachment.name):
            J[:, :, axis, self.chain.length_columns[column]] -= 1.0
        sigmas = np.hypot(attachment.sigmas, BODY_M)[:, None]
        rows = 3 * len(attachment.sigmas)
        return (J / sigmas[..., None]).reshape(len(poses), rows, -1), (off / sigmas).reshape(len(poses), rows)

    def _step(self, H: Array, g: Array, damping: float) -> Array:
        """Steps (T, n) of all that is unknown."""
        reduced, gradient, own, by_lasting = self._reduced(H, g, damping)
        damped = reduced + damping * np.diag(np.diag(reduced))
        lasting = -np.linalg.solve(damped, gradient) if len(damped) else gradient
        step = np.zeros((len(H), self.chain.count))
        step[:, self._lasting] = lasting
        step[:, self._moving] = own + by_lasting @ lasting
        return step

    def _reduced(self, H: Array, g: Array, damping: float) -> tuple[Array, Array, Array, Array]:
        """Normal equations of what lasts (K, K), (K), and how what moves follows from it: (T, M), (T, M, K)."""
        moving, lasting = self._moving, self._lasting
        C = H[:, lasting[:, None], lasting].sum(axis=0) + _STIFFENING * np.eye(len(lasting))
        c = g[:, lasting].sum(axis=0)
        A = H[:, moving[:, None], moving]
        A = A + damping * np.einsum("tij,ij->tij", A, np.eye(len(moving))) + _STIFFENING * np.eye(len(moving))
        B = H[:, moving[:, None], lasting]
        solved: Array = -np.linalg.solve(A, np.concatenate([g[:, moving, None], B], axis=2))
        own, by_lasting = solved[..., 0], solved[..., 1:]
        B_transposed = np.swapaxes(B, 1, 2)
        return (
            C + (B_transposed @ by_lasting).sum(axis=0),
            c + (B_transposed @ own[..., None])[..., 0].sum(axis=0),
            own,
            by_lasting,
        )

    def _sigmas(self, H: Array, g: Array) -> Array:
        """(n) of all that is unknown, at the first instant."""
        reduced, _, _, by_lasting = self._reduced(H, g, 0.0)
        lasting = np.linalg.inv(reduced)
        own = H[0][np.ix_(self._moving, self._moving)] + _STIFFENING * np.eye(len(self._moving))
        variances = np.zeros(self.chain.count)
        variances[self._lasting] = np.diag(lasting)
        variances[self._moving] = np.diag(np.linalg.inv(own))
        variances[self._moving] += np.einsum("mk,kl,ml->m", by_lasting[0], lasting, by_lasting[0])
        sigmas: Array = np.sqrt(np.maximum(variances, 0.0))
        return sigmas


def _diagonal(H: Array, columns: slice) -> Array:
    """View (T, F) of the diagonals of matrices (T, n, n) in some columns."""
    diagonal: Array = np.einsum("tii->ti", H[:, columns, columns])
    return diagonal


_LEARN_HZ = 10.0
"""Rate of the instants that the fit keeps at first; neighbours say nothing new."""

_MOST = 200
"""Instants that are kept, spread over all that was seen: the time of a fit grows with them."""

_LEARN_EVERY_S = 0.5
"""Of seen motion, before what is unknown of the equipment is fitted anew."""


class SeenInstants:
    """Instants at which the body was seen to hold the equipment."""

    def __init__(self) -> None:
        self._instants: list[tuple[HeldPoints, Array]] = []
        self._kept_ns, self._period_ns, self._new_s = -(1 << 62), 1e9 / _LEARN_HZ, 0.0

    def add(self, stamp_ns: int, held: HeldPoints, poses: Array) -> bool:
        """Keep an instant, if it says something new; whether it is time to fit."""
        if stamp_ns - self._kept_ns < 0.99 * self._period_ns or not any(h[0] for h in held.holds.values()):
            return False
        self._kept_ns = stamp_ns
        self._instants.append((held, poses.copy()))
        self._new_s += 1e-9 * self._period_ns
        if len(self._instants) > _MOST:
            # All that was seen, at half the rate.
            self._instants = self._instants[::2]
            self._period_ns *= 2.0
        if self._new_s < _LEARN_EVERY_S:
            return False
        self._new_s = 0.0
        return True

    def fit(self, fit: EquipmentFit, lengths: Array) -> FittedEquipment:
        """What stands still and the lengths, fitted to all instants that are kept."""
        held = _together(held for held, _ in self._instants)
        start = np.stack([poses for _, poses in self._instants])
        return fit.solve(start, lengths, held)


def _together(instants: Iterable[HeldPoints]) -> HeldPoints:
    all_of = list(instants)
    return HeldPoints(
        {name: np.concatenate([held.points[name] for held in all_of]) for name in all_of[0].points},
        {name: np.concatenate([held.holds[name] for held in all_of]) for name in all_of[0].holds},
    )
