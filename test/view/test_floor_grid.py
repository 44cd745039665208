"""The floor of the view: a grid beneath the place, which far landmarks do not stretch."""

import numpy as np

from bodycam_ros.view.floor_grid import extent, grid_lines


def test_the_floor_lies_beneath_the_place() -> None:
    points_world = np.random.default_rng(1).uniform((-4.0, 10.0, 0.0), (6.0, 30.0, 3.0), (2000, 3))
    points_world[::100] = (900.0, -900.0, 5.0)  # through a window
    low, high = extent(points_world)
    np.testing.assert_allclose((low, high), [(-6, 7), (8, 33)], atol=2)


def test_a_place_that_nobody_knows_has_a_floor_around_its_origin() -> None:
    low, high = extent(np.zeros((0, 3)))
    assert (low.tolist(), high.tolist()) == ([-5, -5], [5, 5])


def test_lines_are_on_the_floor_at_every_step_and_end_at_its_edges() -> None:
    low, high = np.array([-1, 0]), np.array([1, 3])
    every_metre = grid_lines(low, high, 1.0)
    assert every_metre.shape == (3 + 4, 2, 3)
    assert (every_metre[..., 2] == 0.0).all()
    assert every_metre[:3, 0, 0].tolist() == [-1.0, 0.0, 1.0]
    assert (every_metre[:3, :, 1] == (0.0, 3.0)).all()
    between = grid_lines(low, high, 0.5, 1.0)
    assert sorted({x for x, _ in between[between[:, 0, 1] == 0.0][:2, 0, :2]}) == [-0.5, 0.5]
