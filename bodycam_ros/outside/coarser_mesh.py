"""A scan of many faces made coarse: contours need no more than a few thousand."""

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.geometry import Array
from bodycam_ros.outside.closed_surface import Faces, parts_of, without_empty_faces

_HALVINGS = 12  # of the bracket in which the size of a cell is looked for


def coarser_mesh(vertices: Array, faces: Faces, most_faces: int) -> tuple[Array, Faces]:
    """A mesh (V, 3) [m], (F, 3) with at most so many faces; itself if it has no more.

    The vertices of a part that lie in the same cell of a cubic grid become their mean. Of the sizes of a cell the
    smallest that leaves few enough is taken.
    """
    if len(faces) <= most_faces:
        return vertices, faces
    part = parts_of(len(vertices), faces)
    low, high = 0.0, float(np.ptp(vertices, axis=0).max())
    coarsest = _clustered(vertices, faces, part, high)
    for _ in range(_HALVINGS):
        cell = 0.5 * (low + high)
        clustered = _clustered(vertices, faces, part, cell)
        if len(clustered[1]) > most_faces:
            low = cell
        else:
            high, coarsest = cell, clustered
    return coarsest


def _clustered(vertices: Array, faces: Faces, part: NDArray[np.int32], cell: float) -> tuple[Array, Faces]:
    place = np.floor((vertices - vertices.min(axis=0)) / cell).astype(np.int64)
    _, cluster = np.unique(np.column_stack([part, place]), axis=0, return_inverse=True)
    cluster = cluster.ravel()
    size = np.bincount(cluster)
    means = np.stack([np.bincount(cluster, vertices[:, axis]) for axis in range(3)], axis=1) / size[:, None]
    return without_empty_faces(means, cluster[faces].astype(np.int32))
