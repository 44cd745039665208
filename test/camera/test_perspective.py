"""plumb_bob and rational_polynomial against OpenCV and COLMAP, and the ends of their valid cones."""

from collections.abc import Callable

import cv2
import numpy as np
import pycolmap
import pytest

from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.colmap_model import colmap_model

Make = Callable[..., CameraModel]
Cone = Callable[..., np.ndarray]

LENSES = [
    ("plumb_bob", [-0.28, 0.09, 4e-4, -3e-4, -0.01], 480.0),
    ("plumb_bob", [-0.06, 0.025, 4e-4, -3e-4], 480.0),
    ("plumb_bob", [], 480.0),
    ("rational_polynomial", [0.46, -2.6, 1e-3, -4e-4, 1.5, 0.33, -2.4, 1.44], 420.0),
]


@pytest.mark.parametrize(("model", "d", "f"), LENSES)
def test_project_is_opencvs_and_colmaps(make: Make, cone: Cone, model: str, d: list[float], f: float) -> None:
    camera = make(model, d, f)
    points = cone(np.linspace(0.0, min(camera.max_angle, np.radians(60.0)), 300))
    pixels, valid = camera.project(points)
    assert valid.all()
    opencv, _ = cv2.projectPoints(points, np.zeros(3), np.zeros(3), _matrix(camera), np.array(camera.distortion))
    np.testing.assert_allclose(pixels, opencv.reshape(-1, 2), atol=1e-6)
    np.testing.assert_allclose(pixels, _colmap(camera).img_from_cam(points) - 0.5, atol=1e-6)


@pytest.mark.parametrize(("model", "d", "f"), LENSES)
def test_unproject_is_opencvs_and_colmaps(make: Make, model: str, d: list[float], f: float) -> None:
    camera = make(model, d, f)
    pixels = np.random.default_rng(1).uniform([60, 40], [580, 440], (300, 2))  # where all three converge
    bearings, valid = camera.unproject(pixels)
    assert valid.all()
    plane = bearings[:, :2] / bearings[:, 2:]
    stop = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 500, 1e-13)
    undistort = getattr(cv2, "undistortPointsIter", cv2.undistortPoints)  # OpenCV 4's and 5's name for it
    opencv = undistort(pixels[:, None], _matrix(camera), np.array(camera.distortion), R=None, P=None, criteria=stop)
    np.testing.assert_allclose(plane, opencv.reshape(-1, 2), atol=1e-6 / f)
    np.testing.assert_allclose(plane, _colmap(camera).cam_from_img(pixels + 0.5), atol=1e-6 / f)


def _matrix(camera: CameraModel) -> np.ndarray:
    return np.array([[camera.fx, 0, camera.cx], [0, camera.fy, camera.cy], [0, 0, 1]])


def _colmap(camera: CameraModel) -> pycolmap.Camera:
    name, params = colmap_model(camera)
    return pycolmap.Camera(model=name, width=camera.width, height=camera.height, params=params)
