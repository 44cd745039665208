"""The surfaces of all segments of a body in single arrays, as the kernels take them."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.errors import BodyError
from bodycam_ros.geometry import Array
from bodycam_ros.outside.contour_kernels import NOBODY
from bodycam_ros.outside.surface import OPEN, Surface

Whole = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class BodySurface:
    """Vertices, faces and edges of a body, each with the row of its segment.

    Attributes:
        segment_count: of the body, with and without a surface.
        vertices, segment_of_vertex: (V, 3) in their segments' frames [m], (V,).
        faces, face_normals, face_offsets, segment_of_face: (F, 3), (F, 3), (F,) [m], (F,).
        edges, edge_faces: (E, 2), (E, 2); -1 where there is no second face.
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
        """Of surfaces by segment.

        Raises:
            BodyError: the body has more segments than labels, or none with a surface.
        """
        there = [(row, surfaces[segment]) for row, segment in enumerate(body.segments) if segment in surfaces]
        if not there or len(body.segments) >= NOBODY:
            raise BodyError(
                f"body {body.name}: {len(there)} of its {len(body.segments)} segments have a surface; static cameras "
                f"need one at least, and follow at most {NOBODY - 1} segments"
            )
        vertices_before = np.cumsum([0, *(len(surface.vertices) for _, surface in there)])
        faces_before = np.cumsum([0, *(len(surface.faces) for _, surface in there)])

        def rows(counts: list[int]) -> Whole:
            return np.repeat([row for row, _ in there], counts).astype(np.int64)

        edge_faces = [
            np.where(surface.edge_faces == OPEN, OPEN, surface.edge_faces + before)
            for (_, surface), before in zip(there, faces_before, strict=False)
        ]
        return cls(
            len(body.segments),
            np.concatenate([surface.vertices for _, surface in there]),
            rows([len(surface.vertices) for _, surface in there]),
            _whole([s.faces + before for (_, s), before in zip(there, vertices_before, strict=False)]),
            np.concatenate([surface.face_normals for _, surface in there]),
            np.concatenate([surface.face_offsets for _, surface in there]),
            rows([len(surface.faces) for _, surface in there]),
            _whole([s.edges + before for (_, s), before in zip(there, vertices_before, strict=False)]),
            _whole(edge_faces),
        )


def _whole(values: list[NDArray[np.integer]]) -> Whole:
    return np.ascontiguousarray(np.concatenate(values), np.int64)
