"""Features of two photographs that are each other's likest, by their descriptors alone."""

import numpy as np
from numpy.typing import NDArray

_TAKEN = -1.0  # less than any product of positive numbers


def mutual_matches(first: NDArray[np.float32], second: NDArray[np.float32], max_ratio: float) -> NDArray[np.uint32]:
    """Pairs (M, 2) of rows of RootSIFT descriptors (N, 128) and (K, 128) that are mutual nearest neighbours.

    Args:
        first, second: the descriptors, as floats.
        max_ratio: of the distance to that to the second nearest.
    """
    if len(first) == 0 or len(second) < 2:
        return np.zeros((0, 2), np.uint32)
    # All have about the same length, so the nearest is the one with the largest product.
    products = first @ second.T
    nearest = products.argmax(axis=1)
    rows = np.arange(len(first))
    mutual = products.argmax(axis=0)[nearest] == rows
    best = products[rows, nearest]
    products[rows, nearest] = _TAKEN
    length_squared = float(np.median(np.einsum("ij,ij->i", first, first)))
    squared = 2.0 * (length_squared - best)
    second_squared = 2.0 * (length_squared - products.max(axis=1))
    good = mutual & (squared < max_ratio**2 * second_squared)
    return np.column_stack([rows[good], nearest[good]]).astype(np.uint32)
