"""Searches in lists, against NumPy."""

import numpy as np

from bodycam_ros.registration.descriptor_kernels import FARTHEST, search_lists


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


def test_an_empty_list_has_no_landmark_and_full_bytes_do_not_overflow() -> None:
    known, landmark = np.full((1, 128), 255, np.uint8), np.zeros(1, np.uint32)
    first, lists = np.array([0, 0, 1]), np.array([[0], [1]])
    nearest, best, rival = search_lists(np.zeros((2, 128), np.uint8), lists, first, np.array([0]), known, landmark)
    assert nearest.tolist() == [-1, 0]
    assert best.tolist() == [FARTHEST, 128 * 255**2]
    assert rival.tolist() == [FARTHEST, FARTHEST]
