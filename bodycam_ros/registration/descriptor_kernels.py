"""The likest landmark of each descriptor; in whole numbers, so that every machine finds the same."""

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.kernels import kernel

Bytes = NDArray[np.uint8]
Whole = NDArray[np.int64]

FARTHEST = 1 << 30
"""More than the squared distance of any two descriptors."""

_HALF = 64  # entries of a descriptor


@kernel("(u1[:, ::1], i8[:, ::1], i8[::1], i8[::1], u1[:, ::1], u4[::1])")
def search_lists(
    descriptors: Bytes,
    lists: Whole,
    first_of_list: Whole,
    rows: Whole,
    known: Bytes,
    landmark_of_row: NDArray[np.uint32],
) -> tuple[Whole, Whole, Whole]:
    """The landmark most similar to each descriptor, by some of the lists.

    Args:
        descriptors: (M, 128).
        lists: (M, P) lists searched for each.
        first_of_list: (W + 1,) start of each list in ``rows``.
        rows: (N,) of the table, list by list.
        known: (D, 128) the table.
        landmark_of_row: (D,) their landmarks.

    Returns:
        Landmarks (M,), or -1, and the squared distances (M,) to them and to the next landmark, or ``FARTHEST``.
    """
    count = len(descriptors)
    nearest, best, rival = np.full(count, -1), np.full(count, FARTHEST), np.full(count, FARTHEST)
    for i in range(count):
        for p in range(lists.shape[1]):
            for j in range(first_of_list[lists[i, p]], first_of_list[lists[i, p] + 1]):
                row = rows[j]
                landmark = np.int64(landmark_of_row[row])
                squared = _squared_distance(descriptors, i, known, row, rival[i])
                if landmark == nearest[i]:
                    best[i] = min(best[i], squared)
                elif squared < best[i]:
                    nearest[i], best[i], rival[i] = landmark, squared, best[i]
                elif squared < rival[i]:
                    rival[i] = squared
    return nearest, best, rival


@kernel()
def _squared_distance(a: Bytes, i: int, b: Bytes, j: int, enough: int) -> int:
    """Squared distance; that of half of the entries where it is no less than ``enough`` already."""
    squared = np.int32(0)
    for k in range(_HALF):
        difference = np.int32(a[i, k]) - np.int32(b[j, k])
        squared += np.int32(difference * difference)
    if squared >= enough:
        return int(squared)
    for k in range(_HALF, 2 * _HALF):
        difference = np.int32(a[i, k]) - np.int32(b[j, k])
        squared += np.int32(difference * difference)
    return int(squared)
