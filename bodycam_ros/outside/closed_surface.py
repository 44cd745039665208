"""A surface from any mesh: seams sewn up, empty faces dropped, every part turned outward."""

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import breadth_first_order, connected_components
from scipy.spatial import cKDTree

from bodycam_ros.errors import BodyError
from bodycam_ros.geometry import Array
from bodycam_ros.outside.surface import OPEN, Surface, crossed_sides

_SEAM_M = 1e-5  # vertices nearer than this are one: files round coordinates to micrometres
_MICROMETRE = 6  # decimals of a metre
_LEAST_AREA_M2 = 1e-12  # a face of less has no normal

Faces = NDArray[np.int32]


def closed_surface(segment: str, vertices: Array, faces: NDArray[np.integer]) -> Surface:
    """The surface of a segment from a mesh (V, 3) [m], (F, 3).

    Vertices that lie on each other become one, so that the faces at a seam or a pole are neighbours. Faces of a part
    are wound alike, and outward by the volume that they enclose.

    Raises:
        BodyError: no face has an area.
    """
    vertices, faces = without_empty_faces(*_sewn(np.asarray(vertices, np.float64), faces.astype(np.int32)))
    if not len(faces):
        raise BodyError(f"the mesh of {segment} has no face with an area")
    surface = Surface(segment, vertices, faces)
    return Surface(segment, vertices, _outward(vertices, _wound_alike(faces, surface)))


def without_empty_faces(vertices: Array, faces: Faces) -> tuple[Array, Faces]:
    """The mesh without faces that have no area or come twice, and without vertices that no face has.

    Two faces of the same vertices that are wound in opposite ways enclose nothing, and both go.
    """
    faces = faces[np.linalg.norm(crossed_sides(vertices, faces), axis=1) > 2.0 * _LEAST_AREA_M2]
    # The vertex with the lowest row first; what then follows tells which way round the face is.
    lowest = faces.argmin(axis=1)
    turned = faces[np.arange(len(faces))[:, None], (lowest[:, None] + np.arange(3)) % 3]
    turned = np.unique(turned, axis=0)
    opposite = np.unique(turned[:, [0, 2, 1]], axis=0)
    both, counts = np.unique(np.concatenate([turned, opposite]), axis=0, return_counts=True)
    twofold = {tuple(face) for face in both[counts > 1].tolist()}
    faces = np.array([face for face in turned.tolist() if tuple(face) not in twofold], np.int32).reshape(-1, 3)
    used, faces_of_used = np.unique(faces, return_inverse=True)
    return vertices[used], faces_of_used.reshape(-1, 3).astype(np.int32)


def parts_of(count: int, faces: Faces) -> NDArray[np.int32]:
    """(V) which connected part each of so many vertices belongs to."""
    pairs = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]]])
    _, part = connected_components(_graph(pairs, np.ones(len(pairs)), count), directed=False)
    labels: NDArray[np.int32] = part
    return labels


def _sewn(vertices: Array, faces: Faces) -> tuple[Array, Faces]:
    # Those that are the same to a micrometre first: pairs of thousands on one spot would be millions.
    used, faces_of_used = np.unique(faces, return_inverse=True)
    _, first, same = np.unique(vertices[used].round(_MICROMETRE), axis=0, return_index=True, return_inverse=True)
    vertices, faces = vertices[used][first], same.ravel()[faces_of_used].reshape(-1, 3).astype(np.int32)
    near = cKDTree(vertices).query_pairs(_SEAM_M, output_type="ndarray")
    _, label = connected_components(_graph(near, np.ones(len(near)), len(vertices)), directed=False)
    _, first = np.unique(label, return_index=True)
    sewn: Faces = label[faces].astype(np.int32)
    return vertices[first], sewn


def _wound_alike(faces: Faces, surface: Surface) -> Faces:
    """Turn faces over until neighbours in a part go along their common edge in opposite directions."""
    first, second = surface.edge_faces.T
    neighbours = second != OPEN
    alike = _graph(np.stack([first, second], axis=1)[neighbours], np.ones(int(neighbours.sum())), len(faces))
    pieces, piece = connected_components(alike, directed=False)
    # An edge that two faces go along in the same direction is two open edges of the surface.
    ends = np.sort(surface.edges[~neighbours], axis=1)
    order = np.lexsort(ends.T)
    ends, face = ends[order], first[~neighbours][order]
    same = np.flatnonzero((ends[1:] == ends[:-1]).all(axis=1))
    if not len(same):
        return faces
    clashes = np.stack([piece[face[same]], piece[face[same + 1]]], axis=1)
    clashes = clashes[clashes[:, 0] != clashes[:, 1]]
    graph = _graph(clashes, np.ones(len(clashes)), pieces)
    turned = np.zeros(pieces, bool)
    seen = np.zeros(pieces, bool)
    for start in range(pieces):
        if not seen[start]:
            reached, before = breadth_first_order(graph, start, directed=False)
            for one in reached[1:]:
                turned[one] = not turned[before[one]]
            seen[reached] = True
    over = turned[piece]
    return np.where(over[:, None], faces[:, ::-1], faces)


def _outward(vertices: Array, faces: Faces) -> Faces:
    """Turn over the parts that enclose a negative volume."""
    part = parts_of(len(vertices), faces)[faces[:, 0]]
    # Seen from the part's middle, so that a hole in it makes little difference.
    corners = vertices[faces]
    size = np.maximum(np.bincount(part), 1)
    middle = np.stack([np.bincount(part, corners.mean(axis=1)[:, axis]) for axis in range(3)], axis=1) / size[:, None]
    volume = ((corners[:, 0] - middle[part]) * crossed_sides(vertices, faces)).sum(axis=1) / 6.0
    inside_out = np.bincount(part, volume) < 0.0
    return np.where(inside_out[part][:, None], faces[:, ::-1], faces)


def _graph(pairs: NDArray[np.integer], weights: Array, size: int) -> coo_array:
    return coo_array((weights, (pairs[:, 0], pairs[:, 1])), shape=(size, size))
