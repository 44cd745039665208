"""The surface of a segment as closed meshes, and its contour: the edges between what faces a camera and what does not.

Contours are analytic: nothing is rendered (B 2.3).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.errors import BodyError
from bodycam_ros.geometry import Array

OPEN = -1
"""In place of a second face, at an edge where the surface has a hole."""


@dataclass(frozen=True, eq=False)
class Surface:
    """What can be seen of a segment.

    It may have several closed parts that overlap. ``surface`` makes one of any mesh: without seams, outward.

    Attributes:
        segment: whose it is.
        vertices: (V, 3) in the segment's frame [m].
        faces: (F, 3) rows of ``vertices``, counter-clockwise as seen from outside.
    """

    segment: str
    vertices: Array
    faces: NDArray[np.int32]

    @cached_property
    def face_normals(self) -> Array:
        """(F, 3) outward unit normals, in the segment's frame."""
        normals = crossed_sides(self.vertices, self.faces)
        unit: Array = normals / np.linalg.norm(normals, axis=1, keepdims=True)
        return unit

    @cached_property
    def face_offsets(self) -> Array:
        """(F) distances of the faces' planes from the segment's origin, along their normals [m]."""
        offsets: Array = (self.face_normals * self.vertices[self.faces[:, 0]]).sum(axis=1)
        return offsets

    @property
    def edges(self) -> NDArray[np.int32]:
        """(E, 2) vertices of each edge; of a closed mesh 1.5 times as many as faces."""
        return self._edges_and_faces[0]

    @property
    def edge_faces(self) -> NDArray[np.int32]:
        """(E, 2) faces on both sides of each edge; the second is ``OPEN`` where there is none.

        The first has the edge's vertices in their order, the second in the opposite one. Where more than two faces
        share an edge, they are taken in such pairs, one edge each.
        """
        return self._edges_and_faces[1]

    @cached_property
    def _edges_and_faces(self) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
        start, end = self.faces.ravel(), np.roll(self.faces, -1, axis=1).ravel()
        face = np.repeat(np.arange(len(self.faces), dtype=np.int32), 3)
        low, high = np.minimum(start, end), np.maximum(start, end)
        # The k-th face that goes up an edge is paired with the k-th that goes down it.
        order = np.lexsort((face, start > end, high, low))
        low, high, down, face = low[order], high[order], (start > end)[order], face[order]
        first = np.concatenate([[True], (np.diff(low) != 0) | (np.diff(high) != 0) | np.diff(down)])
        rank = np.arange(len(low)) - np.maximum.accumulate(np.where(first, np.arange(len(low)), 0))
        _, edge = np.unique(np.stack([low, high, rank.astype(np.int32)], axis=1), axis=0, return_inverse=True)
        edge = edge.ravel()
        count = int(edge.max(initial=-1)) + 1
        sides = np.full((count, 2), OPEN, np.int32)
        sides[edge, down.astype(int)] = face
        ends = np.empty((count, 2), np.int32)
        ends[edge, 0], ends[edge, 1] = low, high
        alone = sides[:, 0] == OPEN
        sides[alone], ends[alone] = sides[alone, ::-1], ends[alone, ::-1]
        return ends, sides

    def faces_towards(self, segment_camera: Array) -> NDArray[np.bool_]:
        """(F) whether each face shows its outer side to a camera at (3,) in the segment's frame [m]."""
        towards: NDArray[np.bool_] = self.face_normals @ segment_camera > self.face_offsets
        return towards


def crossed_sides(vertices: Array, faces: NDArray[np.int32]) -> Array:
    """(F, 3) normals of faces, outward and twice as long as the faces are large [m^2]."""
    corner = vertices[faces]
    normals: Array = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    return normals


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
    _, part = scipy.sparse.csgraph.connected_components(_graph(pairs, np.ones(len(pairs)), count), directed=False)
    labels: NDArray[np.int32] = part
    return labels


def _sewn(vertices: Array, faces: Faces) -> tuple[Array, Faces]:
    # Those that are the same to a micrometre first: pairs of thousands on one spot would be millions.
    used, faces_of_used = np.unique(faces, return_inverse=True)
    _, first, same = np.unique(vertices[used].round(_MICROMETRE), axis=0, return_index=True, return_inverse=True)
    vertices, faces = vertices[used][first], same.ravel()[faces_of_used].reshape(-1, 3).astype(np.int32)
    near = scipy.spatial.cKDTree(vertices).query_pairs(_SEAM_M, output_type="ndarray")
    _, label = scipy.sparse.csgraph.connected_components(
        _graph(near, np.ones(len(near)), len(vertices)), directed=False
    )
    _, first = np.unique(label, return_index=True)
    sewn: Faces = label[faces].astype(np.int32)
    return vertices[first], sewn


def _wound_alike(faces: Faces, surface: Surface) -> Faces:
    """Turn faces over until neighbours in a part go along their common edge in opposite directions."""
    first, second = surface.edge_faces.T
    neighbours = second != OPEN
    alike = _graph(np.stack([first, second], axis=1)[neighbours], np.ones(int(neighbours.sum())), len(faces))
    pieces, piece = scipy.sparse.csgraph.connected_components(alike, directed=False)
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
            reached, before = scipy.sparse.csgraph.breadth_first_order(graph, start, directed=False)
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


def _graph(pairs: NDArray[np.integer], weights: Array, size: int) -> "scipy.sparse.coo_array":
    return scipy.sparse.coo_array((weights, (pairs[:, 0], pairs[:, 1])), shape=(size, size))


BULGES = 9
"""Of each segment: three ways to lean, a taper, three to bend, flat rather than round, and thick in the middle."""


def bulge_forms(normals: Array, along: Array) -> Array:
    """(N, BULGES) how far outward a surface is moved by a unit of each bulge.

    Args:
        normals: (N, 3) outward, in the segment's frame.
        along: (N,) height on the segment, -1 at its lower end, 1 at its upper one.
    """
    x, y, z = normals.T
    t = along
    forms: Array = np.column_stack([x, y, z, t, t * x, t * y, t * z, x * x - y * y, t * t - 1.0 / 3.0])
    return forms


def along_of(z: Array, surface: Surface) -> Array:
    """(N,) heights on a segment of points at z (N,) [m]."""
    low, high = surface.vertices[:, 2].min(), surface.vertices[:, 2].max()
    along: Array = 2.0 * (z - low) / (high - low) - 1.0
    return along


def bulged(body: BodyModel, surfaces: Mapping[str, Surface], bulges: Array) -> dict[str, Surface]:
    """Surfaces with bulges (S, BULGES) [m] on them; vertices and faces keep their order."""
    return {
        segment: Surface(segment, _moved(surface, bulges[body.segment_index[segment]]), surface.faces)
        for segment, surface in surfaces.items()
    }


def _moved(surface: Surface, bulges: Array) -> Array:
    """(V, 3) vertices, moved along their normals."""
    normals = np.zeros_like(surface.vertices)
    np.add.at(normals, surface.faces, crossed_sides(surface.vertices, surface.faces)[:, None])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    outward = bulge_forms(normals, along_of(surface.vertices[:, 2], surface)) @ bulges
    moved: Array = surface.vertices + outward[:, None] * normals
    return moved


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
