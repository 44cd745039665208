"""Three angles of a rotation, intrinsic about three different axes, of many rotations at once.

R = R_i(first) R_j(middle) R_k(last), with i, j, k a permutation of x, y, z. Each rotation has two such triples; and at
a middle angle of 90 degrees only the sum or the difference of the other two is determined. Both times the
decomposition here stays near the angles of the previous instant, so that angles do not jump while a limb moves.
"""

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.geometry import Array

# [rad] Nearer than this to the singularity the first angle stays as it was. Noise would turn it by a radian at once,
# and what is lost of the rotation is at most as much as this.
_FROZEN = 1e-4

_PARITY = {"xyz": 1.0, "yzx": 1.0, "zxy": 1.0, "xzy": -1.0, "yxz": -1.0, "zyx": -1.0}
_GENERATORS = np.array(
    [
        [[0.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]],
        [[0.0, 0.0, 1.0], [0.0, 0.0, 0.0], [-1.0, 0.0, 0.0]],
        [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]],
    ]
)


class EulerOrder:
    """The axes of N rotations, such as yzx for each."""

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

    def decompose(self, rotations: Array, previous: Array) -> Array:
        """Angles (N, 3) [rad] of rotations (N, 3, 3), nearest to the previous angles (N, 3) [rad].

        Given the first angle, the other two follow without a singularity from R_i(first)^-1 R = R_j(middle) R_k(last).
        """
        first, middle, last = self._axes.T
        y, x = -self._parity * rotations[self._rows, middle, last], rotations[self._rows, last, last]
        frozen = np.hypot(x, y) < _FROZEN  # the cosine of the middle angle
        principal = np.where(frozen, previous[:, 0], np.arctan2(y, x))
        candidates = np.stack(
            [self._with_first(rotations, angle, previous) for angle in (principal, principal + np.pi)]
        )
        distances = np.sum((candidates - previous) ** 2, axis=-1)
        nearest: Array = candidates[np.argmin(distances, axis=0), self._rows]
        return nearest

    def _with_first(self, rotations: Array, first_angle: Array, previous: Array) -> Array:
        rows, (i, j, k), parity = self._rows, self._axes.T, self._parity
        cosine, sine = np.cos(first_angle)[:, None], (parity * np.sin(first_angle))[:, None]
        row_j = cosine * rotations[rows, j] + sine * rotations[rows, k]
        row_k = cosine * rotations[rows, k] - sine * rotations[rows, j]
        middle_angle = np.arctan2(parity * rotations[rows, i, k], row_k[rows, k])
        last_angle = np.arctan2(parity * row_j[rows, i], row_j[rows, j])
        return nearest_turn(np.stack([first_angle, middle_angle, last_angle], axis=-1), previous)


def nearest_turn(angles: NDArray[np.floating], previous: NDArray[np.floating]) -> Array:
    """Angles (...) [rad] plus as many whole turns as bring them nearest to the previous ones (...) [rad]."""
    turns: Array = angles - 2.0 * np.pi * np.round((angles - previous) / (2.0 * np.pi))
    return turns
