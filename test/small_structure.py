"""A structure of a few cameras and points with exact observations, for tests."""

import numpy as np
from board_picture import looking_at_origin, wide_camera

from bodycam_ros.camera import CameraModel
from bodycam_ros.geometry import inverse, transform_points
from bodycam_ros.mapping.structure import Structure


def small_structure(points: int = 40) -> tuple[Structure, CameraModel]:
    """Three cameras around the origin that see points near it; the third camera sees every other one only."""
    rng = np.random.default_rng(11)
    camera = wide_camera()
    world_T_camera = np.array([looking_at_origin(*c) for c in [(0.5, -1.0, 1.2), (-0.8, -0.6, 1.0), (0.2, 1.1, 1.4)]])
    points_world = rng.uniform(-0.2, 0.2, (points, 3))
    views = np.concatenate([np.repeat([0, 1], points), np.full((points + 1) // 2, 2)])
    rows = np.concatenate([np.arange(points), np.arange(points), np.arange(0, points, 2)])
    pixels = [
        camera.project(transform_points(inverse(world_T_camera[v]), points_world[r : r + 1]))[0][0]
        for v, r in zip(views, rows, strict=True)
    ]
    structure = Structure(
        names=["a.jpg", "b.jpg", "c.jpg"],
        world_T_camera=world_T_camera,
        points_world=points_world,
        colours=rng.integers(0, 256, (points, 3)).astype(np.uint8),
        observation_views=views.astype(np.int64),
        observation_points=rows.astype(np.int64),
        observation_pixels=np.array(pixels),
        observation_features=rows.astype(np.int64),
    )
    return structure, camera
