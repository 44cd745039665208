"""Jacobians of factors by differences."""

from collections.abc import Callable

import gtsam
import numpy as np

SMALL = 1e-6


def assert_linearised(factor: gtsam.NonlinearFactor, values: gtsam.Values, atol: float) -> None:
    """A factor's Jacobian, as gtsam linearises it, is that of its error by differences, at some values."""
    linear, offset = factor.linearize(values).jacobian()
    columns = []
    for key in factor.keys():
        for axis in range(len(values.atVector(key))):
            ends = []
            for sign in (1.0, -1.0):
                moved = gtsam.Values(values)
                x = values.atVector(key).copy()
                x[axis] += sign * SMALL
                moved.update(key, x)
                ends.append(factor.unwhitenedError(moved))
            columns.append((ends[0] - ends[1]) / (2.0 * SMALL))
    np.testing.assert_allclose(linear, np.stack(columns, axis=1), atol=atol)
    np.testing.assert_allclose(offset, -factor.unwhitenedError(values), atol=1e-9)


def numeric_jacobian(function: Callable[[np.ndarray], np.ndarray], count: int) -> np.ndarray:
    """(M, count) how a function of a small vector changes about zero."""
    steps = SMALL * np.eye(count)
    return np.stack([(function(step) - function(-step)) / (2.0 * SMALL) for step in steps], axis=1)
