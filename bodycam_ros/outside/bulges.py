"""What people have on them that capsules have not: a few smooth bulges of each segment, always in the same places."""

from collections.abc import Mapping

import numpy as np

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.geometry import Array
from bodycam_ros.outside.surface import Surface, crossed_sides

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
