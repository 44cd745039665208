"""The surface of a body: closed meshes on its segments, with the edges along which contours may run (B 2.3)."""

from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.errors import BodyError
from bodycam_ros.geometry import Array

if TYPE_CHECKING:
    from scipy.sparse import csr_array

OPEN = -1
"""In place of a second face, at an edge where the surface has a hole."""
NOBODY = 255
"""Label of pixels beside the body."""


Faces = NDArray[np.int32]
Whole = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Surface:
    """The mesh of a segment; it may have several closed parts that overlap.

    Attributes:
        vertices: (V, 3) in the segment's frame [m].
        faces: (F, 3) rows of ``vertices``, counter-clockwise as seen from outside.
    """

    vertices: Array
    faces: Faces

    @cached_property
    def scaled_normals(self) -> Array:
        """(F, 3) outward normals, in the segment's frame, twice as long as the faces are large [m^2]."""
        return np.asarray(face_normals(self.vertices, self.faces), np.float64)


def join_meshes(meshes: list[tuple[Array, Faces]]) -> tuple[Array, Faces]:
    """Several meshes, each of vertices (V, 3) and faces (F, 3), as one."""
    before = np.cumsum([0, *(len(vertices) for vertices, _ in meshes)])
    faces = np.concatenate([faces + row for (_, faces), row in zip(meshes, before, strict=False)])
    return np.concatenate([vertices for vertices, _ in meshes]), faces.astype(np.int32)


def face_normals(vertices: NDArray[np.floating], faces: Faces) -> NDArray[np.floating]:
    """(F, 3) outward normals of a mesh (V, 3), (F, 3), twice as long as the faces are large."""
    a, b, c = (vertices[faces[:, corner]] for corner in range(3))
    normals: NDArray[np.floating] = np.cross(b - a, c - a)
    return normals


def vertex_neighbours(count: int, faces: Faces) -> "csr_array":
    """(count, count) one where two vertices of a closed mesh (F, 3) share an edge."""
    from scipy.sparse import csr_array  # a quarter of a second to load, which trackers do without

    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])  # closed: each both ways
    return csr_array((np.ones(len(edges)), (edges[:, 0], edges[:, 1])), shape=(count, count))


def vertex_normals(vertices: NDArray[np.floating], faces: Faces) -> NDArray[np.floating]:
    """(V, 3) unit normals of a mesh (V, 3), (F, 3): the mean of the faces around each vertex, weighted by their areas.

    They have the precision of the vertices.
    """
    across = face_normals(vertices, faces)
    sums = np.zeros_like(vertices)
    for axis in range(3):
        sums[:, axis] = sum(np.bincount(faces[:, corner], across[:, axis], len(vertices)) for corner in range(3))
    normals: NDArray[np.floating] = sums / np.maximum(np.linalg.norm(sums, axis=1, keepdims=True), 1e-12)
    return normals.astype(vertices.dtype)


@dataclass(frozen=True, eq=False)
class BodySurface:
    """Vertices, faces and edges of a body, each with the row of its segment.

    Attributes:
        segment_count: of the body, with and without a surface.
        vertices, segment_of_vertex: (V, 3) in their segments' frames [m], (V,).
        faces, face_normals, face_offsets, segment_of_face: (F, 3), (F, 3), (F,) [m], (F,).
        edges, edge_faces: (E, 2), (E, 2); ``OPEN`` where there is no second face.
    """

    segment_count: int
    vertices: Array
    segment_of_vertex: Whole
    faces: Whole
    face_normals: Array
    face_offsets: Array
    segment_of_face: Whole
    edges: Whole
    edge_faces: Whole

    @classmethod
    def of(cls, body: BodyModel, surfaces: Mapping[str, Surface]) -> "BodySurface":
        """A body's surface of surfaces by segment.

        Raises:
            BodyError: the body has more segments than labels, or none with a surface.
        """
        known = {row: surfaces[segment] for row, segment in enumerate(body.segments) if segment in surfaces}
        if not known or len(body.segments) >= NOBODY:
            raise BodyError(
                f"body {body.name}: {len(known)} of its {len(body.segments)} segments have a surface; static cameras "
                f"need one at least, and follow at most {NOBODY - 1} segments"
            )
        rows, parts = np.array([*known]), list(known.values())
        vertices, faces = join_meshes([(part.vertices, part.faces) for part in parts])
        normals = np.concatenate([part.scaled_normals for part in parts])
        normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
        return cls(
            len(body.segments),
            vertices,
            rows.repeat([len(part.vertices) for part in parts]),
            faces.astype(np.int64),
            normals,
            (normals * vertices[faces[:, 0]]).sum(axis=1),
            rows.repeat([len(part.faces) for part in parts]),
            *edges_of(faces),
        )


def edges_of(faces: NDArray[np.integer]) -> tuple[Whole, Whole]:
    """Vertices (E, 2) of each edge of faces (F, 3), and the faces (E, 2) on both sides; ``OPEN`` where there is none.

    The first face has the edge's vertices in their order, the second in the opposite one. Where more than two faces
    share an edge, they are taken in such pairs, one edge each.
    """
    edges: list[tuple[int, int]] = []
    sides: list[list[int]] = []
    unpaired: dict[tuple[int, int], list[int]] = defaultdict(list)
    for face, corners in enumerate(faces.tolist()):
        for start, end in zip(corners, corners[1:] + corners[:1], strict=True):
            if unpaired[end, start]:
                sides[unpaired[end, start].pop()][1] = face
            else:
                unpaired[start, end].append(len(edges))
                edges.append((start, end))
                sides.append([face, OPEN])
    return np.array(edges, np.int64).reshape(-1, 2), np.array(sides, np.int64).reshape(-1, 2)
