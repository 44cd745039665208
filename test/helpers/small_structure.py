"""A structure of a few cameras and points with exact observations, for tests."""

import numpy as np

from bodycam_ros.camera import CameraModel, camera_from_info
from bodycam_ros.geometry import inverse, transform_points
from bodycam_ros.mapping.structure import Structure
from helpers.board_picture import looking_at_origin, wide_camera


def fisheye_camera() -> CameraModel:
    k = [150.0, 0.0, 161.0, 0.0, 151.0, 118.0, 0.0, 0.0, 1.0]
    return camera_from_info("fisheye", 320, 240, "equidistant", [-0.0137, 0.0037, -0.0015, 0.0004], k)


def small_structure(points: int = 40) -> Structure:
    """Three views around the origin of points near it; the third, by a fisheye, sees every other one only."""
    rng = np.random.default_rng(11)
    cameras, camera_of_view = (wide_camera(), fisheye_camera()), np.array([0, 0, 1])
    world_T_camera = np.array([looking_at_origin(*c) for c in [(0.5, -1.0, 1.2), (-0.8, -0.6, 1.0), (0.2, 1.1, 1.4)]])
    points_world = rng.uniform(-0.2, 0.2, (points, 3))
    views = np.concatenate([np.repeat([0, 1], points), np.full((points + 1) // 2, 2)])
    rows = np.concatenate([np.arange(points), np.arange(points), np.arange(0, points, 2)])
    pixels = [
        cameras[camera_of_view[v]].project(transform_points(inverse(world_T_camera[v]), points_world[r : r + 1]))[0][0]
        for v, r in zip(views, rows, strict=True)
    ]
    return Structure(
        names=["a.jpg", "b.jpg", "c.jpg"],
        cameras=cameras,
        camera_of_view=camera_of_view,
        world_T_camera=world_T_camera,
        points_world=points_world,
        colours=rng.integers(0, 256, (points, 3)).astype(np.uint8),
        observation_views=views.astype(np.int64),
        observation_points=rows.astype(np.int64),
        observation_pixels=np.array(pixels),
        observation_features=rows.astype(np.int64),
    )
