from dataclasses import replace

import numpy as np
import pytest
from helpers.known_lenses import CHARUCO, LENSES, held, views_of
from helpers.naming import names, numbers
from helpers.rendered_board import held_poses

from bodycam_ros.geometry import exp_so3, rigid
from bodycam_ros.lens.lens_fit import as_model, fit_lens, initial_fit, lens_numbers, with_lens
from bodycam_ros.lens.lens_quality import (
    board_coverage,
    image_radius,
    objections,
    ray_difference_px,
    ray_grid,
    validate,
    warnings,
)

_LIT = np.ones((480, 640), dtype=bool)
_FACING = np.diag([1.0, -1.0, -1.0])


def _judged(views):
    start = initial_fit(views, 640, 480)
    fit = fit_lens(as_model("plumb_bob", start), start.views, start.poses)
    area = board_coverage(fit, _LIT)
    reach = min(0.9, area.reach)
    lens = validate(fit, ray_grid(_LIT, reach), ray_grid(_LIT, 1.0, beyond=reach))
    return area, objections(lens), warnings(lens, area, must_be_whole=False)


def test_a_board_held_everywhere_makes_a_lens():
    area, against, warned = _judged(held(LENSES["plumb_bob"]))
    assert against == warned == []
    assert area.coverage > 0.9
    assert area.reach > 0.85
    assert area.tilts > 3


def test_a_board_held_in_the_middle_and_never_tilted_is_named_with_what_to_film():
    random = np.random.default_rng(2)
    poses = [
        rigid(exp_so3(np.array([0.0, 0.0, turn])) @ _FACING, np.array([*random.normal(0.0, 0.01, 2), 0.8 + 0.02 * k]))
        for k, turn in enumerate(random.uniform(-0.5, 0.5, 10))
    ]
    area, _, warned = _judged(views_of(LENSES["plumb_bob"], poses, CHARUCO.inner_corners))
    assert area.tilts == 1
    # Coverage, reach and tilts, each with its own number.
    assert len(warned) >= 2 and any(names(why, f"{area.coverage:.0%}") for why in warned)
    assert any(numbers(why)[:2] == [1, 3] for why in warned)


def test_a_board_that_is_bent_is_refused():
    points = CHARUCO.inner_corners
    bent = points + np.column_stack([np.zeros((len(points), 2)), 2.0 * points[:, 0] ** 2])  # by 2 cm
    camera = LENSES["plumb_bob"]
    views = views_of(camera, held_poses(camera, CHARUCO, 30, size=0.6), bent)
    flat = [replace(s, points_board=s.points_board * [1.0, 1.0, 0.0]) for s in views]
    _, against, _ = _judged(flat)
    assert any(numbers(why)[0] > 1.0 and names(why, "--model") for why in against)  # px


def test_lenses_differ_by_what_they_differ_at_each_pixel() -> None:
    camera, grid = LENSES["equidistant"], ray_grid(_LIT, 0.8)
    assert ray_difference_px(camera, camera, grid).max() < 1e-6
    lens = lens_numbers(camera)
    longer = with_lens(camera, lens * [1.01, 1.01, *np.ones(6)])
    radius_px = np.linalg.norm(grid - lens[2:4], axis=1)
    # A ray keeps its direction, and its pixel moves outward by a hundredth of its distance from the centre.
    np.testing.assert_allclose(ray_difference_px(longer, camera, grid), 0.01 * radius_px, rtol=0.1, atol=0.05)


def test_a_shift_that_a_turn_of_the_camera_explains_is_no_difference() -> None:
    camera, grid = LENSES["equidistant"], ray_grid(_LIT, 0.3)
    shifted = with_lens(camera, lens_numbers(camera) + [0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    assert ray_difference_px(camera, shifted, grid).max() < 0.15


def test_a_pixel_without_a_ray_differs_without_bound() -> None:
    fov = LENSES["fov"]
    outside = np.array([[320.0, 240.0], [300.0, 200.0], [200.0, 240.0], [320.0, 1e5]])
    assert np.isfinite(ray_difference_px(fov, fov, outside)).tolist() == [True, True, True, False]


def test_the_radius_and_the_grid_are_those_of_the_disc_that_is_lit() -> None:
    down, across = np.mgrid[:480, :640]
    distance = np.hypot(across - 319.5, down - 239.5)
    disc = distance < 200.0
    assert image_radius(disc) == pytest.approx(200.0, abs=1.0)
    assert image_radius(np.zeros((480, 640), bool)) == 0.0
    inside = np.linalg.norm(ray_grid(disc, 0.5) - [319.5, 239.5], axis=1)
    assert 90.0 < inside.max() <= 100.5


def test_a_board_in_one_half_covers_one_half() -> None:
    camera = LENSES["plumb_bob"]
    poses = [pose for pose in held_poses(camera, CHARUCO, 120, size=0.35) if pose[0, 3] < -0.05 * pose[2, 3]]
    views = views_of(camera, poses, CHARUCO.inner_corners)
    fit = fit_lens(camera, views, np.array([poses[int(view.name)] for view in views]), fixed=True)
    area = board_coverage(fit, _LIT)
    assert area.is_covered[:, :3].mean() > 0.8 and not area.is_covered[:, 6:].any()
    assert area.coverage == pytest.approx(area.is_covered.mean())


def test_expected_errors_grow_with_the_noise_of_the_pictures() -> None:
    camera = LENSES["plumb_bob"]
    poses = held_poses(camera, CHARUCO, 30, size=0.6)
    lenses = []
    for noise_px in (0.1, 0.4):
        views = views_of(camera, poses, CHARUCO.inner_corners, noise_px)
        fit = fit_lens(camera, views, np.array([poses[int(view.name)] for view in views]))
        lenses.append(validate(fit, ray_grid(_LIT, 0.8), ray_grid(_LIT, 0.8)[:0]))
    assert lenses[1].median_px / lenses[0].median_px == pytest.approx(4.0, rel=0.1)
    ratio = lenses[1].lens_sigma[:4] / lenses[0].lens_sigma[:4]
    np.testing.assert_allclose(ratio, 4.0, rtol=0.3)
