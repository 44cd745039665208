"""What lasts over a motion, once the unknowns of each instant are eliminated.

The instants of an articulated motion depend on each other through what lasts alone: the body, its mounts, the clocks of
its cameras. Each is eliminated on its own by a Schur complement.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_STIFFENING = 1e-6
"""Relative to the diagonal: keeps the inverse of an instant in which a segment was not seen."""


@dataclass(frozen=True, eq=False)
class EliminatedInstants:
    """The lasting unknowns' normal equations, of each instant; the moving ones are eliminated.

    Attributes:
        hessians: (T, K, K).
        gradients: (T, K).
        own_steps: (T, M) of the moving unknowns, where the lasting ones stay.
        by_lasting: (T, M, K) how those change with the lasting ones.
    """

    hessians: Array
    gradients: Array
    own_steps: Array
    by_lasting: Array

    def moving(self, lasting: Array) -> Array:
        """The step (T, M) of the moving unknowns for one (K) of the lasting ones."""
        step: Array = self.own_steps + self.by_lasting @ lasting
        return step


def eliminate_instants(J_moving: Array, J_lasting: Array, hessians: Array, gradients: Array) -> EliminatedInstants:
    """Eliminate the moving unknowns.

    Args:
        J_moving: (T, C, 6, M) how the cameras' poses move with the unknowns of their instant.
        J_lasting: (T, C, 6, K) the same with the lasting ones.
        hessians: (T, C, 6, 6) of the cameras' poses.
        gradients: (T, C, 6).
    """
    HJ_moving, HJ_lasting = hessians @ J_moving, hessians @ J_lasting
    flat = (len(J_moving), -1)

    def product(left: Array, right: Array) -> Array:
        columns = left.shape[-1], right.shape[-1]
        rows = left.reshape(*flat, columns[0]), right.reshape(*flat, columns[1])
        out: Array = np.swapaxes(rows[0], 1, 2) @ rows[1]
        return out

    gradient_column = gradients[..., None]
    A = product(J_moving, HJ_moving)
    B = product(J_moving, HJ_lasting)
    C = product(J_lasting, HJ_lasting)
    a = product(J_moving, gradient_column)[..., 0]
    c = product(J_lasting, gradient_column)[..., 0]
    A = A + (_STIFFENING * np.einsum("tii->ti", A).mean() * np.eye(A.shape[-1]))
    A_inverse_B = np.linalg.solve(A, B)
    A_inverse_a = np.linalg.solve(A, a[..., None])[..., 0]
    B_transposed = np.swapaxes(B, 1, 2)
    return EliminatedInstants(
        hessians=C - B_transposed @ A_inverse_B,
        gradients=c - (B_transposed @ A_inverse_a[..., None])[..., 0],
        own_steps=-A_inverse_a,
        by_lasting=-A_inverse_B,
    )


def distance_weights(squared: Array, known: NDArray[np.bool_], outlier_sigmas: float) -> Array:
    """Weights (T, C) by each camera's squared distance from where the body puts it, in its own sigmas (Cauchy).

    Args:
        squared: (T, C) Mahalanobis distances.
        known: (T, C) whether there is one; the others weigh nothing.
        outlier_sigmas: distance at which a camera counts half.
    """
    usual = float(np.sqrt(np.median(squared[known]))) if known.any() else 1.0
    # While the body is far from right all cameras are far from it; then the usual distance is no outlier's.
    weights: Array = known / (1.0 + squared / (outlier_sigmas * max(1.0, usual)) ** 2)
    return weights
