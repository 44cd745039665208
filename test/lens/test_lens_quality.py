from dataclasses import replace

import numpy as np
from helpers.known_lenses import CHARUCO, LENSES, held, views_of
from helpers.rendered_board import held_poses

from bodycam_ros.geometry import exp_so3, rigid
from bodycam_ros.lens.lens_fit import as_model, fit_lens, initial_fit
from bodycam_ros.lens.lens_quality import board_coverage, objections, ray_grid, validate, warnings

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
    assert "tilt it by" in " ".join(warned) and "red" in " ".join(warned)


def test_a_board_that_is_bent_is_refused():
    points = CHARUCO.inner_corners
    bent = points + np.column_stack([np.zeros((len(points), 2)), 2.0 * points[:, 0] ** 2])  # by 2 cm
    camera = LENSES["plumb_bob"]
    views = views_of(camera, held_poses(camera, CHARUCO, 30, size=0.6), bent)
    flat = [replace(s, points_board=s.points_board * [1.0, 1.0, 0.0]) for s in views]
    _, against, _ = _judged(flat)
    assert any("left out are off by" in why and "its file right" in why for why in against)
