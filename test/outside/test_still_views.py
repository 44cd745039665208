"""Whether images of a camera were taken from one place, by what they show; with landmarks that are known exactly."""

import numpy as np
import pytest

from bodycam_ros.camera import camera_from_info
from bodycam_ros.geometry import Array, exp_se3, inverse, transform_points
from bodycam_ros.outside.still_views import View, seen_together, taken_elsewhere
from bodycam_ros.registration.pose_fit import PoseFitSettings, fit_pose

CAMERA = camera_from_info("door", 640, 480, "plumb_bob", [], [470.0, 0.0, 320.0, 0.0, 470.0, 240.0, 0.0, 0.0, 1.0])
STANDS = exp_se3(np.array([0.4, -0.2, 0.1, 1.0, 2.0, 1.5]))
SIGMAS, TOLERANCE_PX = 6.0, 1.0
RNG = np.random.default_rng(5)
POINTS_WORLD = transform_points(STANDS, RNG.uniform([-2.5, -2.0, 4.0], [2.5, 2.0, 8.0], (120, 3)))


def view(world_T_camera: Array, landmarks: int = 120, first: int = 0) -> View:
    """An image of some of the landmarks from a pose, with the noise that patches have."""
    rows = np.arange(first, first + landmarks)
    pixels, _ = CAMERA.project(transform_points(inverse(world_T_camera), POINTS_WORLD[rows]))
    pixels += RNG.normal(0.0, 0.3, pixels.shape)
    fit = fit_pose(CAMERA, POINTS_WORLD[rows], pixels, world_T_camera, PoseFitSettings())
    return View(CAMERA, rows, POINTS_WORLD[rows], pixels, fit)


def moved(turn_deg: float = 0.0, shift_m: float = 0.0) -> Array:
    return STANDS @ exp_se3(np.array([0.0, np.radians(turn_deg), 0.0, shift_m, 0.0, 0.0]))


@pytest.mark.parametrize(
    ("world_T_camera", "still"),
    [(STANDS, True), (moved(turn_deg=0.06), True), (moved(turn_deg=0.3), False), (moved(shift_m=0.1), False)],
)
def test_a_shift_that_hardly_matters_is_none(world_T_camera: Array, still: bool) -> None:
    assert view(world_T_camera).is_at(STANDS, SIGMAS, TOLERANCE_PX) == still


def test_without_a_tolerance_the_sigmas_decide() -> None:
    assert view(STANDS).is_at(STANDS, SIGMAS, 0.0)
    assert not view(moved(turn_deg=0.3)).is_at(STANDS, SIGMAS, 0.0)
    assert view(moved(turn_deg=0.3), landmarks=120).is_at(STANDS, 100.0, 0.0)


def test_who_looks_the_other_way_is_elsewhere() -> None:
    assert not view(STANDS).is_at(moved(turn_deg=180.0), SIGMAS, TOLERANCE_PX)


def test_landmarks_of_several_views_count_once_where_most_have_them() -> None:
    views = {0: view(STANDS, 60), 1: view(STANDS, 60, first=30), 5: view(STANDS, 60, first=30)}
    views[5].pixels[3] += 40.0
    rows, pixels = seen_together(views)
    assert rows.tolist() == list(range(30, 90))
    expected, _ = CAMERA.project(transform_points(inverse(STANDS), POINTS_WORLD[rows]))
    assert np.abs(pixels[33:] - expected[33:]).max() < 2.0  # two of three agree
    rows, pixels = seen_together({0: view(STANDS, 30), 1: view(STANDS, 30, first=60)})
    assert rows.shape == (0,) and pixels.shape == (0, 2)


def test_an_image_that_shows_the_camera_elsewhere_is_named() -> None:
    alone = {0: view(STANDS), 1: view(STANDS), 2: view(moved(turn_deg=5.0))}
    assert not taken_elsewhere({0: alone[0], 1: alone[1]}, {}, STANDS, SIGMAS, TOLERANCE_PX)
    assert set(taken_elsewhere(alone, {}, STANDS, SIGMAS, TOLERANCE_PX)) == {2}
    # From where the others were taken, it shows a few landmarks by chance.
    looked_for = {0: view(STANDS), 1: view(STANDS), 2: view(STANDS, 10)}
    assert set(taken_elsewhere(alone, looked_for, STANDS, SIGMAS, TOLERANCE_PX)) == {2}
    # It moved too little to be lost from sight.
    looked_for[2] = view(moved(turn_deg=0.3))
    alone[2] = view(STANDS)
    assert set(taken_elsewhere(alone, looked_for, STANDS, SIGMAS, TOLERANCE_PX)) == {2}


def test_an_image_that_shows_the_place_was_taken_there_whatever_it_was_registered_as() -> None:
    alone = {0: view(STANDS, 20), 1: view(STANDS, 20), 2: view(moved(turn_deg=8.0, shift_m=2.0), 20)}
    looked_for = {0: view(STANDS), 1: view(STANDS), 2: view(STANDS, 70)}
    assert not taken_elsewhere(alone, looked_for, STANDS, SIGMAS, TOLERANCE_PX)


def test_who_shows_next_to_nothing_says_nothing() -> None:
    alone = {0: view(STANDS), 1: view(STANDS), 2: view(moved(turn_deg=8.0), 14)}
    seen = {0: view(STANDS), 1: view(STANDS)}
    assert not taken_elsewhere(alone, seen, STANDS, SIGMAS, TOLERANCE_PX)
    alone |= {0: view(STANDS, 50), 1: view(STANDS, 50), 2: view(moved(turn_deg=8.0), 30)}
    assert set(taken_elsewhere(alone, seen, STANDS, SIGMAS, TOLERANCE_PX)) == {2}
