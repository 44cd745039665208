"""New tracks are strong, apart, and spread over the image."""

import numpy as np

from bodycam_ros.tracking.replenish import choose_balanced

SHAPE = (480, 640)


def test_fills_the_cells_that_hold_least() -> None:
    rng = np.random.default_rng(0)
    candidates = (rng.random((4000, 2)) * [640, 480]).astype(np.float32)
    existing = (rng.random((60, 2)) * [320, 480]).astype(np.float32)
    strengths = np.where(candidates[:, 0] < 320, 1.0, 0.1).astype(np.float32)
    chosen = choose_balanced(candidates, strengths, existing, SHAPE, 60, cell_px=80, min_distance_px=5.0)
    assert len(chosen) == 60
    assert (candidates[chosen, 0] >= 320).sum() > 45


def test_keeps_its_distance_from_all() -> None:
    rng = np.random.default_rng(1)
    candidates = (rng.random((3000, 2)) * [640, 480]).astype(np.float32)
    existing = candidates[:50] + 1.0
    chosen = choose_balanced(candidates, rng.random(3000).astype(np.float32), existing, SHAPE, 500, 64, 8.0)
    everything = np.concatenate([existing, candidates[chosen]])
    gaps = np.linalg.norm(everything[:, None] - everything[None], axis=2)
    newcomers = slice(len(existing), None)
    gaps[np.arange(len(gaps)), np.arange(len(gaps))] = np.inf
    assert gaps[newcomers].min() > 8.0


def test_the_strongest_of_a_cell_goes_first() -> None:
    candidates = np.array([[10, 10], [30, 30], [50, 50]], np.float32)
    chosen = choose_balanced(candidates, np.array([1, 3, 2], np.float32), np.zeros((0, 2), np.float32), SHAPE, 2, 64, 5.0)
    assert chosen.tolist() == [1, 2]


def test_nothing_on_offer_or_nothing_wanted() -> None:
    some = np.array([[10.0, 10.0]], np.float32)
    none = np.zeros((0, 2), np.float32)
    assert len(choose_balanced(none, np.zeros(0, np.float32), some, SHAPE, 5, 64, 5.0)) == 0
    assert len(choose_balanced(some, np.ones(1, np.float32), none, SHAPE, 0, 64, 5.0)) == 0
