"""The surface of a segment as closed meshes, and its contour: the edges between what faces a camera and what does not.

Contours are analytic: nothing is rendered (B 2.3).
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.geometry import Array

OPEN = -1
"""In place of a second face, at an edge where the surface has a hole."""


@dataclass(frozen=True, eq=False)
class Surface:
    """What can be seen of a segment.

    It may have several closed parts that overlap. ``closed_surface`` makes one of any mesh: without seams, outward.

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

    def contour(self, segment_camera: Array) -> NDArray[np.intp]:
        """(K) rows of ``edges`` between a face towards a camera at (3,) [m] and one away from it, or a hole.

        Those that other faces hide are among them.
        """
        towards = self.faces_towards(segment_camera)
        first, second = self.edge_faces.T
        return np.flatnonzero((second == OPEN) | (towards[first] != towards[second]))


def crossed_sides(vertices: Array, faces: NDArray[np.int32]) -> Array:
    """(F, 3) normals of faces, outward and twice as long as the faces are large [m^2]."""
    corner = vertices[faces]
    normals: Array = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    return normals
