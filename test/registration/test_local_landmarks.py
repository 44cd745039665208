"""The landmarks around a place, against asking every landmark."""

import numpy as np
import pytest
from numpy.typing import NDArray

from bodycam_ros.registration import local_landmarks
from bodycam_ros.registration.local_landmarks import LandmarkGrid, LocalLandmarks

REACH = 300.0


def some_landmarks(count: int, seed: int = 0) -> tuple[NDArray[np.float64], NDArray[np.float32]]:
    """Points of a hall, and sizes of many octaves, some of them none."""
    random = np.random.default_rng(seed)
    sizes = np.exp(random.normal(-4.0, 1.5, count)).astype(np.float32)
    sizes[::17] = 0.0
    return random.uniform([-20, -10, 0], [20, 10, 6], (count, 3)), sizes


def all_within(
    points: NDArray[np.float64], sizes: NDArray[np.float32], centre: NDArray[np.float64], reach: float, margin: float
) -> NDArray[np.int64]:
    near = np.linalg.norm(points - centre, axis=1) <= reach * sizes.astype(float) + margin
    return np.flatnonzero(near & (sizes > 0.0))


@pytest.mark.parametrize("scale", [1.0, 1e-4, 1e5])
def test_what_is_around_is_what_every_landmark_tells(scale: float) -> None:
    """A map without a board has lengths of any scale."""
    points, sizes = some_landmarks(5000)
    points, sizes = scale * points, (scale * sizes).astype(np.float32)
    grid = LandmarkGrid(points, sizes)
    counts = []
    for centre in scale * np.random.default_rng(1).uniform(-30, 30, (40, 3)):
        for reach, margin in [(REACH, 0.3 * scale), (5.0, 0.0), (1e4, scale)]:
            rows = grid.around(centre, reach, margin)
            np.testing.assert_array_equal(rows, all_within(points, sizes, centre, reach, margin))
            counts.append(len(rows))
    assert min(counts) < 10 < 2000 < max(counts)


@pytest.mark.parametrize("many", [0, 10**6])
def test_landmarks_come_go_and_move(monkeypatch: pytest.MonkeyPatch, many: int) -> None:
    """Whether what has changed is kept apart or sorted in."""
    monkeypatch.setattr(local_landmarks, "_MANY_LOOSE", many)
    points, sizes = some_landmarks(2000)
    sizes[1500:] = 0.0
    random = np.random.default_rng(2)
    grid = LandmarkGrid(points, sizes)
    local = LocalLandmarks(grid, 240.0, 0.8)
    centre = np.zeros(3)
    for first in range(1500, 2000, 50):
        rows = np.concatenate([np.arange(first, first + 50), random.choice(first, 60, replace=False)])
        sizes[rows[:50]] = 0.02
        sizes[rows[50:80]] = 0.0
        points[rows[80:]] += random.normal(size=(30, 3)) * 5.0
        grid.put(rows)
        for place in random.uniform(-10, 10, (5, 3)):
            np.testing.assert_array_equal(grid.around(place, REACH, 0.2), all_within(points, sizes, place, REACH, 0.2))
        assert set(all_within(points, sizes, centre, REACH, 0.0)) <= set(local.around(centre).tolist())
