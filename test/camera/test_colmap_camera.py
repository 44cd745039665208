import numpy as np
import pytest

from bodycam_ros.camera import camera_from_info
from bodycam_ros.camera.colmap_camera import colmap_camera


@pytest.mark.parametrize(
    ("model_name", "d", "colmap_name"),
    [
        ("plumb_bob", [0.1, -0.05, 0.001, 0.002, 0.0], "OPENCV"),
        ("plumb_bob", [0.1, -0.05, 0.001, 0.002, 0.01], "FULL_OPENCV"),
        ("equidistant", [0.01, -0.005, 0.001, 0.0], "OPENCV_FISHEYE"),
        ("fov", [0.9], "FOV"),
    ],
)
def test_colmaps_camera_projects_like_ours(model_name, d, colmap_name):
    camera = camera_from_info("c", 640, 480, model_name, d, [300, 0, 321, 0, 301, 239, 0, 0, 1])
    theirs = colmap_camera(camera)
    assert theirs.model.name == colmap_name
    points = np.random.default_rng(0).uniform([-0.5, -0.4, 1.0], [0.5, 0.4, 2.0], (50, 3))
    assert theirs.img_from_cam(points) - 0.5 == pytest.approx(camera.project(points)[0], abs=1e-6)
