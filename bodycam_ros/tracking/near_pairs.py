"""Which of some hundreds of points in a picture lie near each other, without loading a library for it."""

import numpy as np
from numpy.typing import NDArray


def near_pairs(
    points: NDArray[np.floating], others: NDArray[np.floating], radius: float
) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.float64]]:
    """Pairs of points that are at most a radius apart.

    Args:
        points: (N, 2).
        others: (M, 2).
        radius: largest distance, more than zero, in the units of the points.

    Returns:
        Rows (P,) of the points, rows (P,) of the others, and squared distances (P,); in order of the points' rows.
    """
    points, others = np.asarray(points, np.float64), np.asarray(others, np.float64)
    if not (len(points) and len(others)):
        return np.zeros(0, np.intp), np.zeros(0, np.intp), np.zeros(0)
    # All points on one line, band after band of the picture: candidates are three stretches of it.
    reach = radius * (1.0 + 1e-6)
    left = min(points[:, 0].min(), others[:, 0].min()) - 2.0 * reach
    span = max(points[:, 0].max(), others[:, 0].max()) + 2.0 * reach - left
    along = np.floor(others[:, 1] / reach) * span + (others[:, 0] - left)
    order = np.argsort(along)
    along = along[order]
    bands = np.floor(points[:, 1] / reach)[:, None] + np.array([-1.0, 0.0, 1.0])
    places = (bands * span + (points[:, 0] - left)[:, None]).ravel()
    first = np.searchsorted(along, places - reach)
    count = np.searchsorted(along, places + reach, side="right") - first
    rows = np.repeat(np.arange(len(places)) // 3, count)
    near = order[np.arange(len(rows)) + np.repeat(first - (np.cumsum(count) - count), count)]
    offsets = points[rows] - others[near]
    squared = offsets[:, 0] ** 2 + offsets[:, 1] ** 2
    within = squared <= radius * radius
    return rows[within], near[within], squared[within]
