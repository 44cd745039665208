"""The kernels of the lenses are the models in NumPy."""

from collections.abc import Callable

import numpy as np
import pytest
from helpers.numpy_lens import project_with_jacobian_in_numpy, unproject_in_numpy

from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.lens_kernels import (
    project_points,
    project_points_with_jacobian,
    unproject_pixels,
)

Make = Callable[..., CameraModel]
Cone = Callable[..., np.ndarray]

NOWHERE = [
    [0, 0, 0],
    [0, 0, -1],
    [0.01, 0.02, -3],
    [np.nan, 0, 1],
    [0, 0, np.nan],
    [np.inf, 0, 1],
    [0, 0, np.inf],
    [1e200, 0, 1],
]


@pytest.fixture(params=["short_cone", "fov_0", "fov_1.5", "behind"])
def odd_lens(request: pytest.FixtureRequest, make: Make) -> CameraModel:
    """Lenses whose cone ends within the image, at a limit of their model, or behind the camera."""
    return {
        "short_cone": lambda: make("equidistant", [-0.2, 0, 0, 0], 200.0),
        "fov_0": lambda: make("fov", [0.0], 300.0),
        "fov_1.5": lambda: make("fov", [1.5], 200.0),
        "behind": lambda: make("equidistant", [0, 0, 0, 0], 150.0),
    }[request.param]()


def compare(camera: CameraModel, cone: Cone) -> None:
    lens = camera.parameters
    edge = camera.max_angle + np.array([-1e-6, -1e-9, -1e-12, 0.0, 0.5e-9, 1e-8, 1e-6, 1e-3])
    points = np.concatenate([cone(np.linspace(0.0, 3.1, 400)), cone(edge), [[0, 0, 2], [1e-12, 0, 1]], NOWHERE])
    pixels, jacobian, valid = project_with_jacobian_in_numpy(camera, points)
    assert 30 < valid.sum() < len(points) - len(NOWHERE)
    ours, ours_valid = project_points(lens, points)
    np.testing.assert_array_equal(ours_valid, valid)
    np.testing.assert_allclose(ours, pixels, rtol=1e-13, atol=1e-11)
    ours, ours_jacobian, ours_valid = project_points_with_jacobian(lens, points)
    np.testing.assert_array_equal(ours_valid, valid)
    np.testing.assert_allclose(ours, pixels, rtol=1e-13, atol=1e-11)
    size = np.abs(jacobian).max(axis=(1, 2), keepdims=True)
    np.testing.assert_allclose(ours_jacobian / size, jacobian / size, rtol=1e-12, atol=1e-12)

    u, v = np.meshgrid(np.linspace(-200.0, camera.width + 200.0, 91), np.linspace(-200.0, camera.height + 200.0, 71))
    wanted = np.concatenate([np.column_stack([u.ravel(), v.ravel()]), pixels, [[np.inf, 0.0]]])
    bearings, seen = unproject_in_numpy(camera, wanted)
    ours_bearings, ours_seen = unproject_pixels(lens, wanted)
    np.testing.assert_array_equal(ours_seen, seen)
    # Where the cone ends because the distortion cannot be inverted, bearings are as sure as the root of rounding.
    margin = 1e-7 * np.ones(len(wanted))
    margin[np.arccos(np.clip(bearings[:, 2], -1, 1)) < camera.max_angle - 1e-3] = 1e-12
    assert (np.abs(ours_bearings - bearings)[seen].max(axis=1) < margin[seen]).all()
    assert np.isnan(ours_bearings[~seen]).all()


def test_arrays_are_those_of_the_model(lens: CameraModel, cone: Cone) -> None:
    compare(lens, cone)


def test_odd_lenses_are_those_of_the_model(odd_lens: CameraModel, cone: Cone) -> None:
    compare(odd_lens, cone)
