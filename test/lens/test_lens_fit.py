"""The bundle of lens and board against truth: exact data, noise of known size, outliers, OpenCV's solution."""

from collections.abc import Callable
from dataclasses import replace

import cv2
import numpy as np
import pytest
from helpers.known_lenses import CHARUCO, LENSES, held, views_of
from helpers.naming import naming
from helpers.rendered_board import held_poses

from bodycam_ros.boards.board_detector import BoardView
from bodycam_ros.errors import LensError
from bodycam_ros.geometry import exp_se3
from bodycam_ros.lens.lens_calibration import simplest_first
from bodycam_ros.lens.lens_fit import LensFit, as_model, fit_lens, fit_unplaced, initial_fit, lens_numbers, with_lens
from bodycam_ros.lens.lens_quality import ray_difference_px, ray_grid, validate

_LIT = np.ones((480, 640), dtype=bool)
_GRID = ray_grid(_LIT)


@pytest.fixture(scope="module")
def first() -> Callable[[str], LensFit]:
    """Model -> the equidistant lens of pictures that a lens of this model took."""
    made: dict[str, LensFit] = {}

    def get(model: str) -> LensFit:
        if model not in made:
            made[model] = initial_fit(held(LENSES[model]), 640, 480)
        return made[model]

    return get


def _views(model: str, noise_px: float, seed: int = 1) -> tuple[list[BoardView], np.ndarray]:
    """Views of a board with its true poses (V, 4, 4)."""
    camera, points = LENSES[model], CHARUCO.inner_corners
    poses = held_poses(camera, CHARUCO, 30, size=0.6)
    views = views_of(camera, poses, points, noise_px, seed)
    return views, np.array([poses[int(view.name)] for view in views])


@pytest.mark.parametrize("model", LENSES)
def test_every_model_is_found_again_without_knowing_anything(model: str, first: Callable[[str], LensFit]) -> None:
    start = first(model)
    fit = fit_lens(as_model(model, start), start.views, start.poses)
    assert ray_difference_px(fit.camera, LENSES[model], _GRID).max() < 0.15
    # Also without making up for a turn of the camera.
    seen, valid = fit.camera.project(LENSES[model].unproject(_GRID)[0])
    assert valid.all()
    assert np.linalg.norm(seen - _GRID, axis=1).max() < 0.3


@pytest.mark.parametrize("model", LENSES)
def test_exact_points_give_the_exact_lens_and_poses(model: str) -> None:
    views, poses = _views(model, 0.0)
    random = np.random.default_rng(2)
    lens = lens_numbers(LENSES[model])
    lens[:4] += [8.0, 8.0, -6.0, 5.0]
    moved = poses @ exp_se3(random.normal(0.0, 0.01, (len(poses), 6)))
    fit = fit_lens(with_lens(LENSES[model], lens), views, moved)
    assert fit.errors_px.max() < 1e-5
    assert ray_difference_px(fit.camera, LENSES[model], _GRID).max() < 1e-4
    np.testing.assert_allclose(lens_numbers(fit.camera)[:4], lens_numbers(LENSES[model])[:4], atol=1e-3)
    np.testing.assert_allclose(fit.poses, poses, atol=1e-5)


def test_a_fixed_lens_stays_and_the_poses_are_found() -> None:
    views, poses = _views("equidistant", 0.0)
    wrong = with_lens(LENSES["equidistant"], lens_numbers(LENSES["equidistant"]) * [1.1, 1.1, 1, 1, 1, 1, 1, 1])
    assert fit_lens(wrong, views, poses, fixed=True).camera is wrong
    moved = poses @ exp_se3(np.random.default_rng(3).normal(0.0, 0.02, (len(poses), 6)))
    np.testing.assert_allclose(fit_lens(LENSES["equidistant"], views, moved, fixed=True).poses, poses, atol=1e-6)


def test_opencv_has_the_same_lens_of_the_same_points() -> None:
    views, poses = _views("plumb_bob", 0.2)
    fit = fit_lens(LENSES["plumb_bob"], views, poses)
    _, k, d, *_ = cv2.calibrateCamera(
        [view.points_board.astype(np.float32) for view in views],
        [view.pixels.astype(np.float32) for view in views],
        (640, 480),
        None,
        None,
    )
    theirs = with_lens(LENSES["plumb_bob"], np.array([k[0, 0], k[1, 1], k[0, 2], k[1, 2], *d.ravel()[:5]]))
    # Cauchy's weights differ from least squares by less than the noise.
    assert ray_difference_px(fit.camera, theirs, ray_grid(_LIT, 0.8)).max() < 0.1


def test_errors_are_as_large_as_the_noise_that_was_added() -> None:
    views, poses = _views("equidistant", 0.5)
    fit = fit_lens(LENSES["equidistant"], views, poses)
    unknown = 6 * len(fit.views) + len(lens_numbers(fit.camera))
    left_px = 0.5 * np.sqrt(1.0 - unknown / fit.residuals.size)  # the unknowns take their part of the noise
    assert fit.residuals.std() == pytest.approx(left_px, rel=0.03)
    assert fit.median_px == pytest.approx(left_px * np.sqrt(2.0 * np.log(2.0)), rel=0.1)  # Rayleigh's distribution


def test_sigmas_of_the_lens_are_as_large_as_its_errors() -> None:
    errors = []
    for seed in range(6):
        views, poses = _views("equidistant", 0.5, seed)
        lens = validate(fit_lens(LENSES["equidistant"], views, poses), _GRID, _GRID[:0])
        deviation = lens_numbers(lens.fit.camera)[:4] - lens_numbers(LENSES["equidistant"])[:4]
        errors.append(deviation / lens.lens_sigma[:4])
    # Chi-square of 24 numbers, with sigmas of five folds: wrong by a factor of two would fail.
    assert 0.4 < np.mean(np.square(errors)) < 2.5


def test_wrong_corners_do_not_pull_at_the_lens() -> None:
    views, poses = _views("equidistant", 0.05)
    random = np.random.default_rng(5)
    spoiled = []
    for view in views:
        pixels = view.pixels.copy()
        pixels[random.random(len(pixels)) < 0.05] += 15.0
        spoiled.append(replace(view, pixels=pixels))
    fit = fit_lens(LENSES["equidistant"], spoiled, poses)
    assert ray_difference_px(fit.camera, LENSES["equidistant"], _GRID).max() < 0.1
    assert np.mean(fit.errors_px > 10.0) == pytest.approx(0.05, abs=0.02), "they are still there"


def test_pictures_that_the_lens_cannot_show_are_counted() -> None:
    views = held(LENSES["equidistant"])[:5]
    outside = [replace(view, pixels=view.pixels + 5000.0) for view in views[2:]]
    with naming(LensError, "2 of 5 pictures", 3):
        fit_unplaced(LENSES["equidistant"], [*views[:2], *outside])


@pytest.mark.parametrize(("model", "simplest"), [("equidistant", "equidistant"), ("plumb_bob", "plumb_bob")])
def test_the_simplest_lens_for_its_angle_is_tried_first(model, simplest, first):
    """On an ordinary lens an equidistant one of huge coefficients came first."""
    fit = first(model)
    assert simplest_first(fit, np.ones((480, 640), bool))[0] == simplest
