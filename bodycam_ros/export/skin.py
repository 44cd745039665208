"""The surface of a figure: capsules along its bones, as thick as people of its size are, each vertex on one bone."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.export.figure import Figure
from bodycam_ros.geometry import Array, transform_points
from bodycam_ros.outside.capsules import capsule_surfaces
from bodycam_ros.outside.surface import crossed_sides


@dataclass(frozen=True, eq=False)
class Skin:
    """Triangles in the rest pose.

    Attributes:
        vertices: (V, 3) as ``Figure.rest`` has its segments.
        normals: (V, 3) outward unit normals.
        faces: (F, 3) rows of ``vertices``, counter-clockwise as seen from outside.
        bones: (V) row of the bone that moves each vertex.
    """

    vertices: Array
    normals: Array
    faces: NDArray[np.int64]
    bones: NDArray[np.int64]


def skin_of(figure: Figure, body: BodyModel) -> Skin | None:
    """The skin of a figure in units of metres; None if no bone of it has a length."""
    surfaces = capsule_surfaces(body)
    vertices, normals, faces, bones, count = [], [], [], [], 0
    for row, segment in enumerate(figure.segments):
        if segment not in surfaces:
            continue
        surface = surfaces[segment]
        vertices.append(transform_points(figure.rest[row], surface.vertices))
        sides = crossed_sides(vertices[-1], surface.faces)
        summed = np.zeros_like(vertices[-1])
        for corner in range(3):
            np.add.at(summed, surface.faces[:, corner], sides)
        normals.append(summed / np.maximum(np.linalg.norm(summed, axis=1, keepdims=True), 1e-12))
        faces.append(surface.faces.astype(np.int64) + count)
        bones.append(np.full(len(surface.vertices), row, np.int64))
        count += len(surface.vertices)
    if not vertices:
        return None
    return Skin(*(np.concatenate(parts) for parts in (vertices, normals, faces, bones)))
