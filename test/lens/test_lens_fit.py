import numpy as np
import pytest
from helpers.known_lenses import LENSES, held

from bodycam_ros.lens.lens_calibration import simplest_first
from bodycam_ros.lens.lens_fit import as_model, fit_lens, initial_fit
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
def test_every_model_is_found_again_without_knowing_anything(model, first):
    start = first(model)
    fit = fit_lens(as_model(model, start), start.views, start.poses)
    grid = ray_grid(_LIT)
    assert ray_difference_px(fit.camera, LENSES[model], grid).max() < 0.15
    # Also without making up for a turn of the camera.
    seen, valid = fit.camera.project(LENSES[model].unproject(grid)[0])
    assert valid.all()
    assert np.linalg.norm(seen - grid, axis=1).max() < 0.3


@pytest.mark.parametrize(("model", "simplest"), [("equidistant", "equidistant"), ("plumb_bob", "plumb_bob")])
def test_the_simplest_lens_for_its_angle_is_tried_first(model, simplest, first):
    """On an ordinary lens an equidistant one of huge coefficients came first."""
    fit = first(model)
    assert simplest_first(fit, np.ones((480, 640), bool))[0] == simplest
