"""fov against COLMAP's FOV, its formula, and its limits."""

from collections.abc import Callable

import numpy as np
import pycolmap
import pytest

from bodycam_ros.camera import CameraModel, colmap_model

Make = Callable[..., CameraModel]
Cone = Callable[..., np.ndarray]


@pytest.mark.parametrize("omega", [1e-2, 0.5, 0.95, 1.6])
def test_is_colmaps_to_the_edge_of_170_degrees(make: Make, cone: Cone, omega: float) -> None:
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


def test_is_the_published_formula(make: Make) -> None:
    camera = make("fov", [0.9], 300.0)
    undistorted = np.linspace(0.01, 10.0, 50)
    pixels, _ = camera.project(np.column_stack([undistorted, np.zeros(50), np.ones(50)]))
    distorted = np.arctan(2 * undistorted * np.tan(0.9 / 2)) / 0.9
    np.testing.assert_allclose((pixels[:, 0] - camera.cx) / camera.fx, distorted, atol=1e-12)


@pytest.mark.parametrize("omega", [0.0, 1e-12, 1e-6])
def test_vanishing_omega_is_the_pinhole(make: Make, cone: Cone, omega: float) -> None:
    points = cone(np.linspace(0.0, 1.2, 50))
    expected, jacobian, _ = make("plumb_bob", [], 300.0).project_with_jacobian(points)
    pixels, ours, valid = make("fov", [omega], 300.0).project_with_jacobian(points)
    assert valid.all()
    np.testing.assert_allclose(pixels, expected, atol=1e-6)
    np.testing.assert_allclose(ours, jacobian, rtol=1e-6, atol=1e-6)


def test_grows_smoothly_through_90_degrees_where_the_image_reaches_there(make: Make) -> None:
    camera = make("fov", [1.5], 200.0)
    assert camera.max_angle > np.radians(100.0)
    angles = np.radians(np.linspace(80.0, 100.0, 201))
    pixels, valid = camera.project(np.column_stack([np.sin(angles), np.zeros(201), np.cos(angles)]))
    assert valid.all()
    radius = (pixels[:, 0] - camera.cx) / camera.fx
    assert radius[100] == pytest.approx(np.pi / 2 / 1.5, abs=1e-12)
    slope = np.diff(radius)
    assert np.all(slope > 0) and np.all(np.abs(np.diff(slope)) < 1e-2 * slope[:-1])
