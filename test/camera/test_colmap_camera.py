import numpy as np
import pytest

from bodycam_ros.camera.colmap_model import camera_from_colmap, pycolmap


@pytest.mark.parametrize(
    ("name", "parameters"),
    [
        ("SIMPLE_PINHOLE", [300, 321, 239]),
        ("PINHOLE", [300, 302, 321, 239]),
        ("SIMPLE_RADIAL", [300, 321, 239, 0.1]),
        ("RADIAL", [300, 321, 239, 0.1, -0.05]),
        ("OPENCV", [300, 302, 321, 239, 0.1, -0.05, 0.001, 0.002]),
        ("FULL_OPENCV", [300, 302, 321, 239, 0.1, -0.05, 0.001, 0.002, 0.01, 0.02, -0.01, 0.003]),
        ("SIMPLE_FISHEYE", [300, 321, 239]),
        ("FISHEYE", [300, 302, 321, 239]),
        ("SIMPLE_RADIAL_FISHEYE", [300, 321, 239, 0.02]),
        ("RADIAL_FISHEYE", [300, 321, 239, 0.02, -0.01]),
        ("OPENCV_FISHEYE", [300, 302, 321, 239, 0.02, -0.01, 0.003, -0.001]),
        ("FOV", [300, 302, 321, 239, 0.9]),
    ],
)
def test_our_camera_projects_like_colmaps(name, parameters):
    theirs = pycolmap.Camera(model=name, width=640, height=480, params=parameters)
    ours = camera_from_colmap("photograph", theirs)
    points = np.random.default_rng(0).uniform([-0.5, -0.4, 1.0], [0.5, 0.4, 2.0], (50, 3))
    assert ours.project(points)[0] == pytest.approx(theirs.img_from_cam(points) - 0.5, abs=1e-6)
