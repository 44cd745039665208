"""equidistant against OpenCV's fisheye and COLMAP, fov against COLMAP's FOV and its formula, and beyond their ends."""

from collections.abc import Callable

import cv2
import numpy as np
import pycolmap
import pytest

from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.colmap_model import colmap_model

Make = Callable[..., CameraModel]
Cone = Callable[..., np.ndarray]

LENSES = [([0.03, -0.012, 0.004, -6e-4], 212.0), ([-0.04, 0.006, -0.002, 1e-4], 300.0), ([0, 0, 0, 0], 212.0)]


@pytest.mark.parametrize(("d", "f"), LENSES)
def test_equidistant_is_opencvs_and_colmaps_to_the_edge_of_170_degrees(
    make: Make, cone: Cone, d: list[float], f: float
) -> None:
    camera = make("equidistant", d, f)
    points = cone(np.linspace(0.0, np.radians(85.0), 300))
    pixels, valid = camera.project(points)
    assert valid.all()
    K = np.array([[camera.fx, 0, camera.cx], [0, camera.fy, camera.cy], [0, 0, 1]])
    opencv, _ = cv2.fisheye.projectPoints(points[:, None], np.zeros(3), np.zeros(3), K, np.array(d, dtype=float))
    np.testing.assert_allclose(pixels, opencv.reshape(-1, 2), atol=1e-6)
    name, params = colmap_model(camera)
    colmap = pycolmap.Camera(model=name, width=640, height=480, params=params)
    np.testing.assert_allclose(pixels, colmap.img_from_cam(points) - 0.5, atol=1e-6)

    bearings, seen = camera.unproject(pixels)
    assert seen.all()
    plane = bearings[:, :2] / bearings[:, 2:]
    scale = 1.0 + np.sum(plane**2, axis=1, keepdims=True)  # the image plane stretches with 1 / cos^2
    np.testing.assert_allclose(plane / scale, colmap.cam_from_img(pixels + 0.5) / scale, atol=1e-6 / f)
    stop = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 500, 1e-14)
    opencv = cv2.fisheye.undistortPoints(pixels[:, None], K, np.array(d, dtype=float), criteria=stop)
    np.testing.assert_allclose(plane / scale, opencv.reshape(-1, 2) / scale, atol=1e-6 / f)


@pytest.mark.parametrize("omega", [1e-2, 0.5, 0.95, 1.6])
def test_fov_is_colmaps_to_the_edge_of_170_degrees(make: Make, cone: Cone, omega: float) -> None:
    camera = make("fov", [omega], 330.0)
    points = cone(np.linspace(0.0, np.radians(85.0), 300))
    pixels, valid = camera.project(points)
    assert valid.all()
    name, params = colmap_model(camera)
    colmap = pycolmap.Camera(model=name, width=640, height=480, params=params)
    np.testing.assert_allclose(pixels, colmap.img_from_cam(points) - 0.5, atol=1e-6)
    bearings, seen = camera.unproject(pixels)
    assert seen.all()
    plane = bearings[:, :2] / bearings[:, 2:]
    scale = 1.0 + np.sum(plane**2, axis=1, keepdims=True)  # the image plane stretches with 1 / cos^2
    np.testing.assert_allclose(plane / scale, colmap.cam_from_img(pixels + 0.5) / scale, atol=1e-6 / 330.0)
