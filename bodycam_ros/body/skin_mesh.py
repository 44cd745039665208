"""One closed mesh around a body: the smooth union of its limbs as a signed distance field, meshed by manifold3d."""

from collections.abc import Sequence

import numpy as np

from bodycam_ros.body.limb_mesh import Limb, dense_balls, limb_axes
from bodycam_ros.body.skin_kernels import distance_to_limbs
from bodycam_ros.body.surface import Faces
from bodycam_ros.geometry import Array

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
