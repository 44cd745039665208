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


def test_every_direction_of_the_cone_comes_back(lens: CameraModel, cone: Cone) -> None:
    points = cone(np.linspace(0.0, min(lens.max_angle, np.radians(115.0)), 500))
    pixels, valid = lens.project(points)
    bearings, seen = lens.unproject(pixels)
    assert valid.all() and seen.all()
    np.testing.assert_allclose(bearings, points / np.linalg.norm(points, axis=1, keepdims=True), atol=1e-9)


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


def test_on_the_axis_everything_is_exact(lens: CameraModel) -> None:
    pixels, jacobian, valid = lens.project_with_jacobian(np.array([[0.0, 0.0, 2.0]]))
    assert valid.all()
    np.testing.assert_array_equal(pixels, [[lens.cx, lens.cy]])
    unit = jacobian[0, 0, 0] * 2.0 / lens.fx  # all models but fov keep the focal length in the centre
    np.testing.assert_allclose(jacobian[0], [[unit * lens.fx / 2, 0, 0], [0, unit * lens.fy / 2, 0]], atol=1e-12)
    bearings, seen = lens.unproject(np.array([[lens.cx, lens.cy]]))
    assert seen.all()
    np.testing.assert_array_equal(bearings, [[0.0, 0.0, 1.0]])


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


def test_the_edge_of_the_cone_is_sharp(lens: CameraModel, cone: Cone) -> None:
    inside, beyond = cone(np.full(24, lens.max_angle)), cone(np.full(24, lens.max_angle + 1e-5))
    assert lens.project(inside)[1].all()
    assert not lens.project(beyond)[1].any()


def test_pixels_move_outwards_with_the_angle(lens: CameraModel) -> None:
    angle = np.linspace(0.0, min(lens.max_angle, np.radians(89.0)), 2000)
    for direction in np.linspace(0.0, 2.0 * np.pi, 16):
        across = np.sin(angle)
        pixels, valid = lens.project(
            np.column_stack([across * np.cos(direction), across * np.sin(direction), np.cos(angle)])
        )
        assert valid.all()
        assert np.all(np.diff(np.hypot(*(pixels - [lens.cx, lens.cy]).T)) > 0.0)


def test_shapes_of_opencv_and_of_nothing_are_accepted(lens: CameraModel) -> None:
    points = np.array([[[0.1, 0.2, 1.0]], [[0.0, 0.1, 2.0]]], dtype=np.float32)
    pixels, valid = lens.project(points)
    assert pixels.shape == (2, 2) and pixels.dtype == np.float64 and valid.shape == (2,)
    assert lens.unproject(pixels[:, None, :].astype(np.float32))[0].shape == (2, 3)
    pixels, jacobian, valid = lens.project_with_jacobian(np.empty((0, 3)))
    assert pixels.shape == (0, 2) and jacobian.shape == (0, 2, 3) and valid.shape == (0,)
    assert lens.unproject(np.empty((0, 2)))[0].shape == (0, 3)


def test_points_given_are_left_as_they_are(lens: CameraModel) -> None:
    points, pixels = np.array([[0.1, 0.2, -1.0], [0.1, 0.2, 1.0]]), np.array([[1.0, 2.0], [np.nan, 3.0]])
    lens.project(points), lens.project_with_jacobian(points), lens.unproject(pixels)
    np.testing.assert_array_equal(points, [[0.1, 0.2, -1.0], [0.1, 0.2, 1.0]])
    np.testing.assert_array_equal(pixels, [[1.0, 2.0], [np.nan, 3.0]])


def test_image_ends_at_the_outer_border_of_its_pixels(lens: CameraModel) -> None:
    pixels = np.array([[-0.5, -0.5], [639.5, 479.5], [-0.51, 5], [5, -0.51], [639.51, 5], [5, 479.51], [np.nan, 5]])
    np.testing.assert_array_equal(lens.in_image(pixels), [True, True, False, False, False, False, False])
