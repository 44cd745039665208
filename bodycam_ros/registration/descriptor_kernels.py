"""How alike descriptors are, one pair after the other; whole numbers, so that every machine finds the same."""

import math

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.kernels import kernel

Bytes = NDArray[np.uint8]
Whole = NDArray[np.int64]

FARTHEST = 1 << 30
"""More than the squared distance of any two descriptors."""

_HALF = 64  # entries of a descriptor


@kernel("(u1[:, ::1], i8[::1], u1[:, ::1], i8[::1])")
def squared_distances(descriptors: Bytes, features: Whole, known: Bytes, looks: Whole) -> Whole:
    """(P,) squared distances of pairs of descriptors, given by their rows (P,) in two tables (M, 128), (D, 128)."""
    squared = np.empty(len(features), np.int64)
    for p in range(len(features)):
        squared[p] = _squared_distance(descriptors, features[p], known, looks[p], FARTHEST)
    return squared


@kernel("(u1[:, ::1], i8[:, ::1], i8[::1], i8[::1], u1[:, ::1], u4[::1], i8[::1], i8[::1], i8[::1])")
def search_lists(
    descriptors: Bytes,
    lists: Whole,
    first_of_list: Whole,
    looks: Whole,
    known: Bytes,
    landmark_of_look: NDArray[np.uint32],
    nearest: Whole,
    best: Whole,
    rival: Whole,
) -> None:
    """Mend for each descriptor which landmark is most like it, by some of the lists that looks are in.

    Args:
        descriptors: (M, 128).
        lists: (M, P) those to be searched for each.
        first_of_list: (W + 1,) where each begins in ``looks``.
        looks: (N,) rows of the looks, list by list.
        known: (D, 128) descriptors of all looks.
        landmark_of_look: (D,) their landmarks.
        nearest: (M,) most alike so far, or -1; mended.
        best, rival: (M,) squared distances to it, and to the next landmark; mended.
    """
    for i in range(len(descriptors)):
        for p in range(lists.shape[1]):
            for j in range(first_of_list[lists[i, p]], first_of_list[lists[i, p] + 1]):
                look = looks[j]
                landmark = np.int64(landmark_of_look[look])
                squared = _squared_distance(descriptors, i, known, look, rival[i])
                if landmark == nearest[i]:
                    best[i] = min(best[i], squared)
                elif squared < best[i]:
                    nearest[i], best[i], rival[i] = landmark, squared, best[i]
                elif squared < rival[i]:
                    rival[i] = squared


@kernel()
def _squared_distance(a: Bytes, i: int, b: Bytes, j: int, enough: int) -> int:
    """Or, if it is no less than ``enough``, what half of the entries tell, if that is so already: most are far away."""
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


@kernel("(f8[:, ::1], i8[::1], f8[:, ::1], f8[:, ::1], i8[::1], i8[::1])")
def givers_of_looks(
    points_world: NDArray[np.float64],
    landmark_of_look: NDArray[np.int64],
    sides: NDArray[np.float64],
    centres: NDArray[np.float64],
    first_observation: NDArray[np.int64],
    observers: NDArray[np.int64],
) -> NDArray[np.int64]:
    """(D,) which photograph gave each look: that which stood most on its side. -1: none.

    Args:
        points_world: (L, 3) landmarks [m].
        landmark_of_look: (D,) their rows.
        sides: (D, 3) unit directions from the landmark to whoever gave the look.
        centres: (K, 3) where photographs were taken [m].
        first_observation, observers: (L + 1,), (O,) the photographs that see each landmark; of (0,), all see all.
    """
    givers = np.empty(len(landmark_of_look), np.int64)
    for look in range(len(landmark_of_look)):
        i = landmark_of_look[look]
        first, last = 0, len(centres)
        if len(observers) > 0:
            first, last = first_observation[i], first_observation[i + 1]
        best, givers[look] = -2.0, -1
        for o in range(first, last):
            k = observers[o] if len(observers) > 0 else o
            x, y, z = (
                centres[k, 0] - points_world[i, 0],
                centres[k, 1] - points_world[i, 1],
                centres[k, 2] - points_world[i, 2],
            )
            cosine = (x * sides[look, 0] + y * sides[look, 1] + z * sides[look, 2]) / math.sqrt(x * x + y * y + z * z)
            if cosine > best:
                best, givers[look] = cosine, k
    return givers
