"""One closed mesh around a body, by manifold3d.

It is the smooth union of the body's limbs, meshed from their signed distance field; or the union of scanned surfaces.
"""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from bodycam_ros.body.limb_mesh import Limb, dense_balls, limb_axes
from bodycam_ros.body.skin_kernels import distance_to_limbs
from bodycam_ros.body.surface import Faces, Surface
from bodycam_ros.errors import BodyError
from bodycam_ros.geometry import Array, transform_points

if TYPE_CHECKING:
    from manifold3d import Manifold

_GRID_SMOOTHINGS, _SEAM_SMOOTHINGS = 20, 5  # steps that take away ridges of the grid, and slivers of scans' seams
_MOST_CELLS = 2_000_000  # of the grid: some ten seconds; a person's has 120 000
_FILLET = 0.045
"""Reach of fillets where limbs meet, in statures: it rounds shoulders, the neck and the crotch."""


def skin_mesh(placed: Sequence[tuple[Array, Limb]], edge_m: float, stature_m: float) -> tuple[Array, Faces]:
    """A closed mesh (V, 3) [m], (F, 3), outward, around limbs.

    Args:
        placed: pose world_T_segment (4, 4) of each limb's segment, and the limb in its segment's frame.
        edge_m: longest edge [m], approximately; longer for limbs that are far apart.
        stature_m: of the body [m].
    """
    from manifold3d import Manifold  # with trimesh half a second to load; exports without a skin do without

    frames, balls, first, ends = [], [], [0], []
    for world_T_segment, (start, end, along, across) in placed:
        axes = limb_axes(start, end, across) @ world_T_segment[:3, :3].T
        at, radii, breadth, depth = dense_balls(start, end, along)
        reach = at[:, None] * axes[0]
        largest = radii * np.maximum(1.0, np.maximum(breadth, depth))
        middle = 0.5 * (reach[0] + reach[-1])
        around = (np.linalg.norm(reach - middle, axis=1) + largest).max()
        origin = world_T_segment[:3, :3] @ start + world_T_segment[:3, 3]
        frames.append(np.concatenate([origin, axes.ravel(), origin + middle, [around]]))
        balls.append(np.stack([at, radii, radii * breadth, radii * depth], axis=1))
        first.append(first[-1] + len(at))
        ends += [origin + reach - largest[:, None], origin + reach + largest[:, None]]
    fields = np.array(frames), np.concatenate(balls), np.array(first, np.int64)
    fillet = _FILLET * stature_m
    corners = np.concatenate(ends)
    low, high = corners.min(axis=0) - fillet, corners.max(axis=0) + fillet
    edge_m = max(edge_m, float(np.cbrt(np.prod(high - low) / _MOST_CELLS)))
    solid = Manifold.level_set(
        lambda x, y, z: -distance_to_limbs(x, y, z, *fields, fillet), [*low.tolist(), *high.tolist()], edge_m
    )
    return _smoothed(solid, _GRID_SMOOTHINGS)


def joined_mesh(placed: Mapping[str, tuple[Array, Surface]], edge_m: float) -> tuple[Array, Faces]:
    """A closed mesh (V, 3) [m], (F, 3), outward, around surfaces that overlap.

    Args:
        placed: segment -> its pose world_T_segment (4, 4), and its surface.
        edge_m: longest edge [m]: longer ones are divided, so that the mesh bends.

    Raises:
        BodyError: a surface is not closed; the message names its segment.
    """
    from manifold3d import Error, Manifold, Mesh64, OpType

    parts = []
    for segment, (world_T_segment, surface) in placed.items():
        points = np.ascontiguousarray(transform_points(world_T_segment, surface.vertices))
        solid = Manifold(Mesh64(points, np.ascontiguousarray(surface.faces, np.uint64)))
        if solid.status() != Error.NoError or solid.is_empty():
            raise BodyError(f"the surface of {segment} is not closed; close its holes, or leave its file out")
        parts += solid.decompose()
    return _smoothed(Manifold.batch_boolean(parts, OpType.Add).refine_to_length(edge_m), _SEAM_SMOOTHINGS)


def _smoothed(solid: "Manifold", steps: int) -> tuple[Array, Faces]:
    """The mesh of a solid after steps of Taubin's filter, which keeps its volume."""
    from trimesh import Trimesh
    from trimesh.smoothing import filter_taubin

    mesh = solid.to_mesh64()
    smooth = Trimesh(np.array(mesh.vert_properties)[:, :3], np.array(mesh.tri_verts), process=False)
    filter_taubin(smooth, iterations=steps)  # type: ignore[no-untyped-call]
    return np.array(smooth.vertices, np.float64), np.array(smooth.faces, np.int32)
