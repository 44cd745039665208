"""A ball to film, of which everything is known."""

import numpy as np
import trimesh

from bodycam_ros.film.character import PALETTE, PosedMesh

SIZE = (320, 240)
"""Width and height of its pictures [px]."""


def ball(centre: list[float], radius: float) -> PosedMesh:
    mesh = trimesh.creation.icosphere(subdivisions=4, radius=radius)
    shares = np.zeros((len(mesh.vertices), len(PALETTE)), np.float32)
    shares[:, 0] = 1.0
    return PosedMesh((mesh.vertices + centre).astype(np.float32), mesh.faces.astype(np.int32), shares)
