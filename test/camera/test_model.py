"""What holds for every camera model."""

from collections.abc import Callable

import numpy as np

from bodycam_ros.camera import CameraModel

Cone = Callable[..., np.ndarray]


def test_every_pixel_of_the_image_projects_back_to_itself(lens: CameraModel) -> None:
    u, v = np.meshgrid(np.linspace(-0.5, lens.width - 0.5, 81), np.linspace(-0.5, lens.height - 0.5, 61))
    pixels = np.column_stack([u.ravel(), v.ravel()])
    bearings, seen = lens.unproject(pixels)
    assert seen.all()
    np.testing.assert_allclose(np.linalg.norm(bearings, axis=1), 1.0, atol=1e-12)
    again, valid = lens.project(7.0 * bearings)
    assert valid.all()
    np.testing.assert_allclose(again, pixels, atol=1e-8)
    assert lens.in_image(again[1:-1]).mean() > 0.9  # rounding may put border pixels just outside


def test_jacobian_is_the_numeric_one(lens: CameraModel, cone: Cone) -> None:
    points = cone(np.concatenate([[0.0, 1e-12, 1e-8, 1e-5], np.linspace(1e-3, 0.98 * lens.max_angle, 200)]))
    points[:, :] /= np.linalg.norm(points, axis=1, keepdims=True)
    pixels, jacobian, valid = lens.project_with_jacobian(points)
    assert valid.all()
    np.testing.assert_allclose(pixels, lens.project(points)[0], rtol=1e-13, atol=1e-10)
    step = 1e-6 * np.maximum(points[:, 2:], 0.02)
    for axis, unit in enumerate(np.eye(3)):
        ahead, behind = lens.project(points + step * unit)[0], lens.project(points - step * unit)[0]
        numeric = (ahead - behind) / (2.0 * step)
        scale = np.abs(jacobian).max(axis=(1, 2))[:, None]
        np.testing.assert_allclose(jacobian[:, :, axis] / scale, numeric / scale, atol=1e-6)


def test_what_no_lens_sees_is_invalid_and_nan(lens: CameraModel) -> None:
    nowhere = [
        [0, 0, 0],
        [0, 0, -1],
        [0.01, 0.02, -3],
        [0.5, 0.5, -1],
        [np.nan, 0, 1],
        [0, 0, np.nan],
        [np.inf, 0, 1],
        [0, 0, np.inf],
        [np.inf, 0, np.inf],
    ]
    points = np.array([*nowhere, [0.1, 0.2, 1.0]])
    pixels, jacobian, valid = lens.project_with_jacobian(points)
    np.testing.assert_array_equal(valid, [*[False] * len(nowhere), True])
    assert np.isnan(pixels[:-1]).all() and np.isnan(jacobian[:-1]).all()
    assert np.isfinite(pixels[-1]).all() and np.isfinite(jacobian[-1]).all()
    np.testing.assert_array_equal(lens.project(points)[1], valid)
    bearings, seen = lens.unproject(np.array([[np.nan, 0], [0, np.inf], [100, 100]]))
    np.testing.assert_array_equal(seen, [False, False, True])
    assert np.isnan(bearings[:2]).all()
