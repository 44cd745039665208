"""Rank, null space and dependent rows of constraints, whatever the units of rows and columns."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.geometry import Array

_DEPENDENT = 1e-7
"""Of unit rows: loops are closed to 1e-12, so rows that depend on each other do so to rounding."""

_UNMOVED = 1e-10
"""Of the longest row: such a row is rounding."""

_COMPANION = 1e-3


@dataclass(frozen=True)
class DependentRow:
    """A row that others say already: its index, and theirs."""

    row: int
    said_by: tuple[int, ...]


def unit_rows(jacobian: Array) -> Array:
    """The rows (R, K), each of length one; those that nothing moves are zero."""
    lengths = np.linalg.norm(jacobian, axis=1, keepdims=True)
    moved = lengths > _UNMOVED * lengths.max(initial=0.0)
    return np.asarray(np.divide(jacobian, lengths, out=np.zeros_like(jacobian), where=moved), np.float64)


def rank(unit: Array) -> int:
    """Of unit rows (R, K)."""
    if not unit.size:
        return 0
    values = np.linalg.svd(unit, compute_uv=False)
    return int((values > _DEPENDENT * max(values[0], 1.0)).sum())


def null_space(unit: Array) -> Array:
    """(K, F) orthonormal directions that unit rows (R, K) leave free."""
    if not unit.size:
        return np.eye(unit.shape[1])
    _, values, Vt = np.linalg.svd(unit)
    free: Array = Vt[int((values > _DEPENDENT * max(values[0], 1.0)).sum()) :].T
    return free


def dependent_rows(unit: Array) -> tuple[DependentRow, ...]:
    """Rows of (R, K) that are sums of rows before them."""
    independent: list[int] = []
    basis = np.zeros((0, unit.shape[1]))
    found = []
    for row, values in enumerate(unit):
        rest = values - basis.T @ (basis @ values)
        rest -= basis.T @ (basis @ rest)
        length = float(np.linalg.norm(rest))
        if length > _DEPENDENT:
            independent.append(row)
            basis = np.vstack([basis, rest / length])
        else:
            found.append(DependentRow(row, _sum_of(unit, independent, row)))
    return tuple(found)


def _sum_of(unit: Array, independent: list[int], row: int) -> tuple[int, ...]:
    if not independent:
        return ()
    shares: NDArray[np.float64] = np.abs(np.linalg.lstsq(unit[independent].T, unit[row], rcond=_DEPENDENT)[0])
    most = shares.max()
    return tuple(other for other, share in zip(independent, shares, strict=True) if share > _COMPANION * most)
