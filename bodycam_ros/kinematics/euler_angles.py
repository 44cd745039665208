"""A rotation as three angles about three different axes, continuous in time."""

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.geometry import Array, exp_so3, hat

_SINGULAR = 1e-3  # cosine of the middle angle, about, below which the rates of the other two are no longer told apart

# [rad] Nearer than this to the singularity the first angle stays as it was. Noise would turn it by a radian at once,
# and what is lost of the rotation is at most as much as this.
_FROZEN = 1e-4

_PARITY = {"xyz": 1.0, "yzx": 1.0, "zxy": 1.0, "xzy": -1.0, "yxz": -1.0, "zyx": -1.0}
_GENERATORS = hat(np.eye(3))


class EulerOrder:
    """The axes of N rotations, such as yzx for each: three angles a rotation, intrinsic about three different axes.

    R = R_i(first) R_j(middle) R_k(last), with i, j, k a permutation of x, y, z. Each rotation has two such triples; and
    at a middle angle of 90 degrees only the sum or the difference of the other two is determined. Both times the
    decomposition here stays near the angles of the previous instant, so that angles do not jump while a limb moves.
    """

    def __init__(self, orders: tuple[str, ...]) -> None:
        self._axes = np.array([["xyz".index(axis) for axis in order] for order in orders], dtype=int).reshape(-1, 3)
        self._parity = np.array([_PARITY[order] for order in orders])
        self._rows = np.arange(len(orders))

    def compose(self, angles: NDArray[np.floating]) -> Array:
        """Rotations (..., N, 3, 3) of angles (..., N, 3) [rad]."""
        K = _GENERATORS[self._axes]
        sine, versine = np.sin(angles)[..., None, None], 1.0 - np.cos(angles)[..., None, None]
        R = np.eye(3) + sine * K + versine * (K @ K)
        rotations: Array = R[..., 0, :, :] @ R[..., 1, :, :] @ R[..., 2, :, :]
        return rotations

    def rates(self, angles: Array) -> Array:
        """(N, 3, 3) how angles (N, 3) [rad] grow with a turn w of their rotations, R exp(w); least at the singularity.

        Row by angle, column by component of w; the inverse of the Jacobian whose columns are the angles' axes in the
        axes of R.
        """
        first, middle, last = np.swapaxes(np.eye(3)[self._axes], 0, 1)
        R_last = exp_so3(angles[:, 2:] * last)
        R_middle = exp_so3(angles[:, 1:2] * middle) @ R_last
        turns = [(first[:, None] @ R_middle)[:, 0], (middle[:, None] @ R_last)[:, 0], last]
        return np.asarray(np.linalg.pinv(np.stack(turns, axis=2), rcond=_SINGULAR), np.float64)

    def decompose(self, rotations: Array, previous: Array) -> Array:
        """Angles (..., N, 3) [rad] of rotations (..., N, 3, 3), nearest to the previous angles (..., N, 3) [rad].

        Given the first angle, the other two follow without a singularity from R_i(first)^-1 R = R_j(middle) R_k(last).
        """
        first, middle, last = self._axes.T
        y, x = -self._parity * rotations[..., self._rows, middle, last], rotations[..., self._rows, last, last]
        frozen = np.hypot(x, y) < _FROZEN  # the cosine of the middle angle
        principal = np.where(frozen, previous[..., 0], np.arctan2(y, x))
        triples = self._with_first(rotations, np.stack([principal, principal + np.pi]), previous)
        distances = np.sum((triples - previous) ** 2, axis=-1)
        nearest: Array = np.where((distances[0] <= distances[1])[..., None], triples[0], triples[1])
        return nearest

    def _with_first(self, rotations: Array, first_angle: Array, previous: Array) -> Array:
        """Angles (K, ..., N, 3) whose first are given (K, ..., N)."""
        rows, (i, j, k), parity = self._rows, self._axes.T, self._parity
        cosine, sine = np.cos(first_angle)[..., None], (parity * np.sin(first_angle))[..., None]
        row_j = cosine * rotations[..., rows, j, :] + sine * rotations[..., rows, k, :]
        row_k = cosine * rotations[..., rows, k, :] - sine * rotations[..., rows, j, :]
        middle_angle = np.arctan2(parity * rotations[..., rows, i, k], row_k[..., rows, k])
        last_angle = np.arctan2(parity * row_j[..., rows, i], row_j[..., rows, j])
        return nearest_turn(np.stack([first_angle, middle_angle, last_angle], axis=-1), previous)


def nearest_turn(angles: NDArray[np.floating], previous: NDArray[np.floating]) -> Array:
    """Angles (...) [rad] plus as many whole turns as bring them nearest to the previous ones (...) [rad]."""
    turns: Array = angles - 2.0 * np.pi * np.round((angles - previous) / (2.0 * np.pi))
    return turns
