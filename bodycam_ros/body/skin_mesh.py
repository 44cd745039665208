"""One closed mesh around a body, by manifold3d.

It is the smooth union of the body's limbs, meshed from their signed distance field; or the union of scanned surfaces.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from bodycam_ros.body.limb_mesh import Limb, dense_balls, limb_axes
from bodycam_ros.body.skin_kernels import distance_to_limbs
from bodycam_ros.body.surface import Faces, Surface
from bodycam_ros.errors import BodyError
from bodycam_ros.geometry import Array, transform_points

_SMOOTHINGS = 20  # steps that take away what the grid leaves of seams, and keep the volume
_FILLET = 0.045
"""Reach of fillets where limbs meet, in statures: it rounds shoulders, the neck and the crotch."""


def skin_mesh(placed: Sequence[tuple[Array, Limb]], edge_m: float, stature_m: float) -> tuple[Array, Faces]:
    """A closed mesh (V, 3) [m], (F, 3), outward, around limbs.

    Args:
        placed: pose world_T_segment (4, 4) of each limb's segment, and the limb in its segment's frame.
        edge_m: longest edge [m], approximately.
        stature_m: of the body [m].
    """
    from manifold3d import Manifold  # with trimesh half a second to load; exports without a skin do without
    from trimesh import Trimesh
    from trimesh.smoothing import filter_taubin

    frames, balls, first = [], [], [0]
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
    fields = np.array(frames), np.concatenate(balls), np.array(first, np.int64)
    low = (fields[0][:, 12:15] - fields[0][:, 15:]).min(axis=0) - edge_m
    high = (fields[0][:, 12:15] + fields[0][:, 15:]).max(axis=0) + edge_m
    fillet = _FILLET * stature_m
    solid = Manifold.level_set(
        lambda x, y, z: -distance_to_limbs(x, y, z, *fields, fillet), [*low.tolist(), *high.tolist()], edge_m
    )
    mesh = solid.to_mesh64()
    smooth = Trimesh(np.array(mesh.vert_properties)[:, :3], np.array(mesh.tri_verts), process=False)
    filter_taubin(smooth, iterations=_SMOOTHINGS)  # type: ignore[no-untyped-call]
    return np.array(smooth.vertices, np.float64), np.array(smooth.faces, np.int32)


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
    mesh = Manifold.batch_boolean(parts, OpType.Add).refine_to_length(edge_m).to_mesh64()
    return np.array(mesh.vert_properties, np.float64)[:, :3], np.array(mesh.tri_verts, np.int32)
