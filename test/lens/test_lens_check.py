"""The check of a calibration against images: what it is by a real camera that turns, and when it gives no result."""

import numpy as np
import pytest
from helpers.naming import names, numbers
from helpers.turned_view import CAMERA, turned_view

from bodycam_ros.geometry import exp_so3
from bodycam_ros.lens.lens_check import LensMatch, PointPair, match_images, match_lens
from bodycam_ros.lens.lens_fit import lens_numbers, with_lens


def _images(count: int) -> list[np.ndarray]:
    """Images of CAMERA that looks around, as one on a limb does."""
    return [turned_view(22.0 * np.sin(0.13 * number), 18.0 * np.cos(0.11 * number)) for number in range(count)]


def _scaled(scale: float):
    lens = lens_numbers(CAMERA)
    lens[:2] *= scale
    return with_lens(CAMERA, lens)


def _turned_pairs(count: int, turn_deg: float) -> list[PointPair]:
    """Pixels of points far away before and after turns about changing axes."""
    random = np.random.default_rng(8)
    pairs = []
    for number in range(count):
        points = np.column_stack([random.uniform(-0.6, 0.6, (300, 2)), np.ones(300)])
        axis = np.array([np.cos(number), np.sin(number), 0.3])
        turned = points @ exp_so3(np.radians(turn_deg) * axis / np.linalg.norm(axis)).T
        (first, valid), (second, also) = CAMERA.project(points), CAMERA.project(turned)
        seen = valid & also & CAMERA.in_image(first) & CAMERA.in_image(second)
        pairs.append((first[seen], second[seen]))
    return pairs


def test_images_fit_the_lens_that_took_them_and_no_other() -> None:
    images = _images(120)
    given = match_images(CAMERA, images)
    assert given.pairs >= 4 and given.matches and given.error_px < 0.5
    zoomed = match_images(_scaled(0.6), images)
    assert not zoomed.matches and zoomed.best_px < zoomed.error_px
    assert zoomed.scale == pytest.approx(1.0 / 0.6, rel=0.06)


def test_too_few_images_give_no_result() -> None:
    few = match_images(_scaled(0.6), _images(30), most_images=3)
    assert few.pairs < 4 and few.matches
    assert match_lens(_scaled(0.6), _turned_pairs(3, 12.0)).matches
    assert match_lens(_scaled(0.6), _turned_pairs(4, 12.0)).pairs == 4


def test_a_camera_that_hardly_turns_shows_nothing_of_its_lens() -> None:
    still = match_lens(_scaled(0.6), _turned_pairs(8, 2.0))
    assert still.pairs == 0 and still.matches


def test_images_without_texture_give_no_result() -> None:
    assert match_images(CAMERA, [np.full((480, 640), 90, np.uint8)] * 40).pairs == 0


@pytest.mark.parametrize(
    ("scale", "mode"),
    [(0.6, "narrow"), (0.8, "linear"), (0.95, "stabilisation"), (1.1, "stabilisation"), (1.7, "narrow")],
)
def test_a_mismatch_names_camera_errors_scale_and_mode(scale: float, mode: str) -> None:
    text = LensMatch("head", scale, 7.25, 1.5, 6).text
    assert names(text, "camera head") and names(text, "camera_info") and names(text, mode)
    assert numbers(text)[:3] == [pytest.approx(7.2, abs=0.1), 1.5, scale]
