"""Distances of descriptors and searches in lists, against NumPy."""

import numpy as np

from bodycam_ros.registration.descriptor_kernels import FARTHEST, search_lists, squared_distances


def test_distances_are_those_of_numpy() -> None:
    random = np.random.default_rng(0)
    a, b = random.integers(0, 256, (20, 128), np.uint8), random.integers(0, 256, (30, 128), np.uint8)
    a[0], b[0] = 0, 255
    i, j = (indices.ravel() for indices in np.mgrid[:20, :30])
    squared = squared_distances(a, i, b, j)
    np.testing.assert_array_equal(squared, ((a[i].astype(int) - b[j]) ** 2).sum(axis=1))
    assert squared.max() == 128 * 255**2 < FARTHEST


def test_lists_tell_the_nearest_landmark_and_its_rival() -> None:
    random = np.random.default_rng(1)
    known = random.integers(0, 20, (400, 128), np.uint8)
    landmark = np.sort(random.integers(0, 120, 400)).astype(np.uint32)
    list_of_look = random.integers(0, 9, 400)
    looks = np.argsort(list_of_look, kind="stable")
    first = np.searchsorted(list_of_look[looks], np.arange(10)).astype(np.int64)
    descriptors = random.integers(0, 20, (50, 128), np.uint8)
    lists = np.stack([random.choice(9, 3, replace=False) for _ in range(50)])
    nearest, best, rival = search_lists(descriptors, lists, first, looks, known, landmark)
    for row in range(50):
        asked = np.flatnonzero(np.isin(list_of_look, lists[row]))
        squared = ((known[asked].astype(int) - descriptors[row]) ** 2).sum(axis=1)
        assert best[row] == squared.min()
        assert nearest[row] == landmark[asked[squared.argmin()]]
        assert rival[row] == squared[landmark[asked] != nearest[row]].min()
