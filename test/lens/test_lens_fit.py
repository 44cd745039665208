import numpy as np
import pytest
from known_lenses import LENSES, held

from bodycam_ros.lens.lens_fit import as_model, derivatives_by_lens, fit_lens, initial_fit, lens_numbers, with_lens
from bodycam_ros.lens.lens_quality import ray_difference_px, ray_grid

_LIT = np.ones((480, 640), dtype=bool)


@pytest.fixture(scope="module")
def first():
    """Model -> the equidistant lens of pictures that a lens of this model took."""
    made = {}

    def get(model):
        if model not in made:
            made[model] = initial_fit(held(LENSES[model]), 640, 480)
        return made[model]

    return get


@pytest.mark.parametrize("model", LENSES)
def test_derivatives_are_those_of_the_camera_model(model):
    camera = LENSES[model]
    points = np.random.default_rng(0).normal(0.0, 0.4, (40, 3)) + [0.0, 0.0, 1.2]
    points = points[camera.project(points)[1]]
    lens, derivatives = lens_numbers(camera), derivatives_by_lens(camera, points)
    for number in range(len(lens)):
        step = np.zeros(len(lens))
        step[number] = 1e-6
        after, before = (with_lens(camera, lens + sign * step).project(points)[0] for sign in (1.0, -1.0))
        assert derivatives[:, :, number] == pytest.approx((after - before) / 2e-6, rel=1e-4, abs=1e-3)


@pytest.mark.parametrize("model", LENSES)
def test_every_model_is_found_again_without_knowing_anything(model, first):
    start = first(model)
    fit = fit_lens(as_model(model, start), start.views, start.poses)
    grid = ray_grid(_LIT)
    assert ray_difference_px(fit.camera, LENSES[model], grid).max() < 0.15
    # Also without making up for a turn of the camera.
    seen, valid = fit.camera.project(LENSES[model].unproject(grid)[0])
    assert valid.all()
    assert np.linalg.norm(seen - grid, axis=1).max() < 0.3
