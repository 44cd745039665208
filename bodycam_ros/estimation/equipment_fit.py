"""Poses and unknown lengths of the equipment from the body's points that are attached to it (B eq. 15).

The body is given at T times; only the equipment moves, as a chain of twists from its root (B eq. 3-4). So a wrong
attachment shows as a distance before it could bend the body. The pose of a root that stands and the lengths are the
same at all times; a Schur complement eliminates the rest.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.equipment import Attachment, Equipment, UnknownLengths
from bodycam_ros.estimation.equipment_chain import EquipmentChain
from bodycam_ros.geometry import hat, inverse, log_se3
from bodycam_ros.kinematics.joint import Joint

Array = NDArray[np.float64]

AttachedPoints = Mapping[str, Array]
"""Attachment -> (T, N, 3) its points on the body, in the world [m]; NaN where it is not active, or not observed."""

BODY_M = 0.003  # sigma of an observed segment; no pair of points weighs more
_KERNEL = 10.0  # sigmas at which an attachment counts half (Cauchy): a prediction may be as far off
_STEPS = 30
_SETTLED = _STIFFENING = 1e-6  # relative decrease of the cost; added to information, so that it has an inverse


def attached(points: AttachedPoints, time: int = 0) -> list[str]:
    """Names of the attachments whose points are known at a time."""
    return [name for name, each in points.items() if np.isfinite(each[time]).all()]


@dataclass(frozen=True, eq=False)
class FittedEquipment:
    """The outcome of a fit.

    Attributes:
        poses: (T, E, 4, 4) world_T_segment, in the order of ``Equipment.segments``.
        lengths: (L) deviation of the unknown lengths from the file [m].
        cost: robust sum of squares, in sigmas.
        root_sigmas: (6) of the root's pose at the first time [rad], [m].
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
        chain: its segments as functions of root, joints and lengths.
    """

    def __init__(self, equipment: Equipment, tree: Sequence[Joint]) -> None:
        self._equipment = equipment
        self.lengths = UnknownLengths(equipment, tree)
        self.chain = EquipmentChain(equipment, tree, self.lengths)
        lasting = 6 if equipment.segments[equipment.root].stands else 0
        self._lasting = np.concatenate([np.arange(lasting), self.chain.length_columns]).astype(np.intp)
        self._moving = np.setdiff1d(np.arange(self.chain.count), self._lasting)

    def solve(
        self, start: Array, lengths: Array, points: AttachedPoints, root: tuple[Array, Array] | None = None
    ) -> FittedEquipment:
        """Levenberg-Marquardt.

        Args:
            start: (T, E, 4, 4) initial poses; a root that stands starts at the last of them.
            lengths: (L) initial [m].
            points: measured.
            root: measured pose (4, 4) of the root and its sigmas (6) [rad], [m], for T = 1.
        """
        at = start[:, self.chain.root]
        if 0 in self._lasting:
            at = np.broadcast_to(at[-1], at.shape)
        unknowns = (at, self.chain.motions(start, lengths), lengths)
        damping = 0.1
        H, g, cost = self._normal_equations(*unknowns, points, root)
        for _ in range(_STEPS):
            step = self._step(H, g, damping)
            moved = (*self.chain.moved(*unknowns[:2], step), unknowns[2] + step[0, self.chain.length_columns])
            H_new, g_new, cost_new = self._normal_equations(*moved, points, root)
            if not cost_new <= cost:
                damping *= 10.0
                continue
            settled = cost - cost_new < _SETTLED * (1.0 + cost)
            unknowns, H, g, cost, damping = moved, H_new, g_new, cost_new, 0.2 * damping
            if settled:
                break
        sigmas = self._sigmas(H, g)
        poses = self.chain.poses(*unknowns)[0]
        return FittedEquipment(poses, unknowns[2], cost, sigmas[:6], sigmas[self.chain.length_columns])

    def _normal_equations(
        self, root: Array, motions: Array, lengths: Array, points: AttachedPoints, measured: tuple[Array, Array] | None
    ) -> tuple[Array, Array, float]:
        """Hessians (T, n, n), gradients (T, n) and the robust cost."""
        T, n = len(root), self.chain.count
        poses, moves = self.chain.poses(root, motions, lengths)
        H, g, cost = np.zeros((T, n, n)), np.zeros((T, n)), 0.0
        diagonal = np.einsum("tii->ti", H)  # a view

        def add_independent(times: slice, columns: slice | NDArray[np.intp], off: Array, sigmas: Array) -> None:
            """Add residuals ``off`` (T, F) of single columns."""
            nonlocal cost
            diagonal[times, columns] += sigmas**-2.0
            g[times, columns] += off / sigmas**2
            cost += float(np.sum((off / sigmas) ** 2))

        for attachment in self._equipment.attachments:
            is_known = np.isfinite(points[attachment.name]).all(axis=(1, 2))
            if is_known.any():
                on_body = np.nan_to_num(points[attachment.name])
                J, r = self._pairs(attachment, poses, moves, lengths, on_body)
                squared = np.sum(r**2, axis=1) / len(attachment.sigmas) / _KERNEL**2
                weighted = np.swapaxes(J, 1, 2) * (is_known / (1.0 + squared))[:, None, None]
                H += weighted @ J
                g += (weighted @ r[..., None])[..., 0]
                cost += len(attachment.sigmas) * _KERNEL**2 * float(np.sum(np.log1p(squared)[is_known]))
        if np.isfinite(sigma := self._equipment.upright_sigma):
            up = root[:, 2, :3]
            J_up, r_up = hat(up)[:, :2] / sigma, up[:, :2] / sigma
            H[:, :3, :3] += np.swapaxes(J_up, 1, 2) @ J_up
            g[:, :3] += (np.swapaxes(J_up, 1, 2) @ r_up[..., None])[..., 0]
            cost += float(np.sum(r_up**2))
        for row, sigmas in enumerate(self.chain.sigmas):
            off = log_se3(motions[:, row]) @ self.chain.twists[row]
            add_independent(slice(None), self.chain.columns[row], off, sigmas)
        if measured is not None:
            add_independent(slice(None), slice(0, 6), log_se3(inverse(measured[0]) @ root), measured[1])
        # Lengths have one prior, not one at every time.
        add_independent(slice(0, 1), self.chain.length_columns, lengths, self.lengths.priors)
        return H, g, cost

    def _pairs(
        self, attachment: Attachment, poses: Array, moves: Array, lengths: Array, on_body: Array
    ) -> tuple[Array, Array]:
        """Jacobians (T, 3N, n) and residuals (T, 3N) of an attachment's pairs, in its equipment segment's axes."""
        row = self.chain.row[attachment.equipment_segment]
        pose = poses[:, row]
        measured = (on_body - pose[:, None, :3, 3]) @ pose[:, :3, :3]
        off = measured - self.lengths.attachment(attachment, lengths).on_equipment
        by_segment = np.concatenate([hat(measured), np.broadcast_to(-np.eye(3), (*measured.shape, 3))], axis=3)
        J = by_segment @ moves[:, None, row]
        for column, axis in self.lengths.columns(attachment.name):
            J[:, :, axis, self.chain.length_columns[column]] -= 1.0
        sigmas = np.hypot(attachment.sigmas, BODY_M)[:, None]
        rows = 3 * len(attachment.sigmas)
        return (J / sigmas[..., None]).reshape(len(poses), rows, -1), (off / sigmas).reshape(len(poses), rows)

    def _step(self, H: Array, g: Array, damping: float) -> Array:
        """Steps (T, n) of all unknowns."""
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
        A = H[:, moving[:, None], moving]
        A = A + damping * np.einsum("tij,ij->tij", A, np.eye(len(moving))) + _STIFFENING * np.eye(len(moving))
        B = H[:, moving[:, None], lasting]
        solved: Array = -np.linalg.solve(A, np.concatenate([g[:, moving, None], B], axis=2))
        own, by_lasting = solved[..., 0], solved[..., 1:]
        C += np.einsum("tmk,tml->kl", B, by_lasting)
        return C, g[:, lasting].sum(axis=0) + np.einsum("tmk,tm->k", B, own), own, by_lasting

    def _sigmas(self, H: Array, g: Array) -> Array:
        """(n) of all unknowns, at the first time."""
        reduced, _, _, by_lasting = self._reduced(H, g, 0.0)
        lasting = np.linalg.inv(reduced)
        own = H[0][np.ix_(self._moving, self._moving)] + _STIFFENING * np.eye(len(self._moving))
        variances = np.zeros(self.chain.count)
        variances[self._lasting] = np.diag(lasting)
        variances[self._moving] = np.diag(np.linalg.inv(own) + by_lasting[0] @ lasting @ by_lasting[0].T)
        sigmas: Array = np.sqrt(np.maximum(variances, 0.0))
        return sigmas


_KEEP_HZ = 10.0  # rate of the kept times at first; neighbours add no information
_MOST = 200  # kept times: a fit takes as long as there are many
_FIT_EVERY_S = 0.5  # of new measurements between two fits


class AttachedHistory:
    """Times at which points of the body attached to the equipment were measured, for a fit of what lasts."""

    def __init__(self) -> None:
        self._kept: list[tuple[AttachedPoints, Array]] = []
        self._kept_ns, self._period_ns, self._new_s = -(1 << 62), 1e9 / _KEEP_HZ, 0.0

    def add(self, stamp_ns: int, points: AttachedPoints, poses: Array) -> bool:
        """Keep one time with poses (E, 4, 4), unless it is too near to the last; whether a fit is due."""
        if stamp_ns - self._kept_ns < 0.99 * self._period_ns or not attached(points):
            return False
        self._kept_ns = stamp_ns
        self._kept.append((points, poses.copy()))
        self._new_s += 1e-9 * self._period_ns
        if len(self._kept) > _MOST:
            self._kept, self._period_ns = self._kept[::2], 2.0 * self._period_ns
        is_due = self._new_s >= _FIT_EVERY_S
        self._new_s = 0.0 if is_due else self._new_s
        return is_due

    def fit(self, fit: EquipmentFit, lengths: Array) -> FittedEquipment:
        """Root that stands and lengths (L), fitted to all kept times."""
        points = {name: np.concatenate([each[name] for each, _ in self._kept]) for name in self._kept[0][0]}
        return fit.solve(np.stack([poses for _, poses in self._kept]), lengths, points)
