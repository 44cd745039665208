"""Pictures of known shapes: where they are, what hides them, and their shadow."""

import numpy as np
import pytest
from helpers.filmed_ball import SIZE, ball

from bodycam_ros.camera import CameraModel
from bodycam_ros.errors import ViewError
from bodycam_ros.film.lighting import SUN
from bodycam_ros.film.picture import Band, PictureMaker
from bodycam_ros.film.place import Place
from bodycam_ros.film.ray_scene import RayScene
from bodycam_ros.film.views import fitted_lens, fitted_window, looking_at, outside_lens
from bodycam_ros.geometry import inverse, transform_points

EMPTY = Place(0.0, np.zeros((0, 3)), np.zeros((0, 3), np.uint8), None)
FISHEYE = CameraModel("fisheye", *SIZE, 95.0, 96.0, 158.0, 121.0, (0.03, -0.01, 0.002, 0.0), "equidistant")
GREY = np.full((SIZE[1], SIZE[0], 3), 128, np.uint8)


def wall(spacing_m: float) -> Place:
    """Points of a wall at x = 1, left of y = 0, that faces a camera at the origin."""
    y, z = np.meshgrid(np.arange(0.0, 3.0, spacing_m), np.arange(-2.0, 4.0, spacing_m))
    points = np.stack([np.ones(y.size), y.ravel(), z.ravel()], axis=1)
    normals = np.broadcast_to([-1.0, 0.0, 0.0], points.shape)
    return Place(None, points, np.zeros(points.shape, np.uint8), normals)


def test_a_ball_is_drawn_where_the_wide_lens_projects_it() -> None:
    world_T_camera = looking_at(np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 1.0]))
    mesh = ball([1.0, -1.6, 1.4], 0.3)  # 58 deg off the axis
    maker = PictureMaker(FISHEYE, (0, 0, *SIZE), EMPTY)
    drawn = np.any(maker.draw(mesh, world_T_camera, GREY, shaded=False) != GREY, axis=2)
    pixels = FISHEYE.project(transform_points(inverse(world_T_camera), mesh.vertices.astype(float)))[0]
    rows, columns = np.nonzero(drawn)
    ends = [columns.min(), columns.max(), rows.min(), rows.max()]
    expected = [pixels[:, 0].min(), pixels[:, 0].max(), pixels[:, 1].min(), pixels[:, 1].max()]
    np.testing.assert_allclose(ends, expected, atol=1.0)
    assert drawn[tuple(np.round(pixels.mean(axis=0)).astype(int)[::-1])]


def test_edges_are_blended() -> None:
    lens = outside_lens(*SIZE)
    picture = PictureMaker(lens, (0, 0, *SIZE), EMPTY).draw(
        ball([4.0, 0.0, 1.0], 0.5), looking_at(np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 1.0])), GREY, shaded=False
    )
    red = picture[SIZE[1] // 2, :, 2].astype(int) - 128
    inside = np.flatnonzero(red)
    assert 0 < abs(red[inside[0]]) < abs(red[inside[3]]), "the first pixel is covered in part"


def test_the_shadow_falls_away_from_the_sun() -> None:
    centre = np.array([4.0, 0.0, 1.0])
    world_T_camera = looking_at(np.array([0.0, 0.0, 3.0]), np.array([4.0, 0.0, 0.0]))
    lens = outside_lens(*SIZE)
    mesh = ball(centre.tolist(), 0.3)
    maker = PictureMaker(lens, (0, 0, *SIZE), EMPTY)
    with_shadow = maker.draw(mesh, world_T_camera, GREY).astype(int)
    without = maker.draw(mesh, world_T_camera, GREY, shaded=False).astype(int)
    fallen = centre - SUN * centre[2] / SUN[2]
    (u, v), *_ = np.round(lens.project(transform_points(inverse(world_T_camera), fallen[None]))[0]).astype(int)
    change = (without - with_shadow).sum(axis=2)
    assert change[v, u] > 0.8 * change.max() > 60
    mirrored = centre + np.array([1.0, 1.0, -1.0]) * SUN * centre[2] / SUN[2]
    (u, v), *_ = np.round(lens.project(transform_points(inverse(world_T_camera), mirrored[None]))[0]).astype(int)
    assert change[v, u] < 0.1 * change.max()


def test_a_mapped_wall_hides_what_is_behind_it_and_nothing_else() -> None:
    world_T_camera = looking_at(np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 1.0]))
    lens = outside_lens(*SIZE)
    place = wall(0.05)
    maker = PictureMaker(lens, (0, 0, *SIZE), place)
    behind, before = ball([2.0, 0.0, 1.0], 0.3), ball([0.8, 0.0, 1.0], 0.1)
    drawn = np.any(maker.draw(behind, world_T_camera, GREY, hidden=True) != GREY, axis=2)
    whole = np.any(maker.draw(behind, world_T_camera, GREY) != GREY, axis=2)
    left, right = np.s_[:, : SIZE[0] // 2], np.s_[:, SIZE[0] // 2 + 40 :]  # discs reach 7 cm over the edge, at y = 0
    assert whole[left].sum() > 1000 and not drawn[left].any()
    np.testing.assert_array_equal(drawn[right], whole[right])
    drawn = np.any(maker.draw(before, world_T_camera, GREY, hidden=True) != GREY, axis=2)
    np.testing.assert_array_equal(drawn, np.any(maker.draw(before, world_T_camera, GREY) != GREY, axis=2))


def test_few_points_are_no_surface() -> None:
    world_T_camera = looking_at(np.array([0.0, 1.5, 1.0]), np.array([1.0, 1.5, 1.0]))
    lens = outside_lens(*SIZE)
    assert PictureMaker(lens, (0, 0, *SIZE), wall(0.05)).is_dense(world_T_camera)
    assert not PictureMaker(lens, (0, 0, *SIZE), wall(0.4)).is_dense(world_T_camera)
    assert not PictureMaker(lens, (0, 0, *SIZE), EMPTY).is_dense(world_T_camera)


def test_nothing_is_drawn_beside_an_image() -> None:
    size = (480, 240)
    lens, window = fitted_lens(FISHEYE, size), fitted_window(*SIZE, size)
    assert window == (80, 0, 320, 240)
    image = np.full((240, 480, 3), 128, np.uint8)
    world_T_camera = looking_at(np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 1.0]))
    drawn = np.any(
        PictureMaker(lens, window, EMPTY).draw(ball([0.5, 0.0, 1.0], 0.45), world_T_camera, image) != image, axis=2
    )
    assert drawn[:, 80:400].mean() > 0.3
    assert not drawn[:, :80].any() and not drawn[:, 400:].any()


def test_what_is_not_installed_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "embreex.mesh_construction", None)
    with pytest.raises(ViewError, match=r"embreex.*pip install"):
        RayScene(np.zeros((3, 3)), np.array([[0, 1, 2]], np.int32))


def test_rows_that_were_exposed_later_show_the_person_later() -> None:
    world_T_camera = looking_at(np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 1.0]))
    maker = PictureMaker(FISHEYE, (0, 0, *SIZE), EMPTY)
    middle = SIZE[1] // 2
    times = [ball([2.0, y, 1.0], 0.6) for y in (0.0, 0.25)]
    drawn = maker.draw(
        times[0],
        world_T_camera,
        GREY,
        shaded=False,
        bands=[
            Band(0, middle, times[0], world_T_camera),
            Band(middle, SIZE[1], times[1], looking_at(np.array([0.0, 0.1, 1.0]), np.array([1.0, 0.1, 1.0]))),
        ],
    )
    later = ball([2.0, 0.15, 1.0], 0.6)  # as seen from a camera that moved by 0.1 m, too
    for rows, mesh in ((slice(0, middle - 1), times[0]), (slice(middle + 1, None), later)):
        is_ball = np.any(maker.draw(mesh, world_T_camera, GREY, shaded=False) != GREY, axis=2)
        np.testing.assert_array_equal(np.any(drawn != GREY, axis=2)[rows], is_ball[rows])
