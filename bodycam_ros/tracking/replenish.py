"""Which new features become tracks: strong ones, spread over the image."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree


def choose_balanced(
    candidates: NDArray[np.float32],
    strengths: NDArray[np.float32],
    existing: NDArray[np.float32],
    image_shape: tuple[int, ...],
    count: int,
    cell_px: int,
    min_distance_px: float,
) -> NDArray[np.intp]:
    """Choose candidates so that every cell of a grid holds about as many features as any other.

    Args:
        candidates: (N, 2) pixels of the features on offer.
        strengths: (N,) their responses; within a cell the strongest goes first.
        existing: (M, 2) pixels of the tracks that are there already.
        image_shape: (height, width) of the image.
        count: how many to choose at most.
        cell_px: side of a cell [px].
        min_distance_px: distance that a chosen one keeps from the existing and from each other [px].

    Returns:
        Rows of ``candidates``, ordered by how badly they are needed.
    """
    if count <= 0 or len(candidates) == 0:
        return np.zeros(0, np.intp)
    columns = image_shape[1] // cell_px + 1
    cell_of_candidate = _cells(candidates, cell_px, columns)
    occupancy = np.bincount(_cells(existing, cell_px, columns), minlength=columns * (image_shape[0] // cell_px + 1))

    order = np.lexsort((-strengths, cell_of_candidate))
    sorted_cells = cell_of_candidate[order]
    rank_in_cell = np.arange(len(order)) - np.searchsorted(sorted_cells, sorted_cells)
    queue = order[np.lexsort((-strengths[order], occupancy[sorted_cells] + rank_in_cell))]

    free = np.ones(len(candidates), bool)
    if len(existing):
        near, _ = cKDTree(existing).query(candidates, distance_upper_bound=min_distance_px)
        free = ~np.isfinite(near)
    neighbours = cKDTree(candidates).query_ball_point(candidates, min_distance_px)
    chosen: list[int] = []
    for row in queue:
        if free[row]:
            chosen.append(int(row))
            free[neighbours[row]] = False
            if len(chosen) == count:
                break
    return np.asarray(chosen, np.intp)


def _cells(pixels: NDArray[np.float32], cell_px: int, columns: int) -> NDArray[np.intp]:
    column, row = (pixels // cell_px).astype(np.intp).reshape(-1, 2).T
    return np.asarray(row * columns + column, np.intp)
