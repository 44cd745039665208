"""The index of landmarks, against searching the same lists one by one; and an index that grows."""

import numpy as np
import pytest
from numpy.typing import NDArray

from bodycam_ros.registration import landmark_index
from bodycam_ros.registration.landmark_index import LandmarkIndex
from bodycam_ros.registration.visual_words import VisualWords

EVERY = 64


def some_looks(landmarks: int, seed: int = 0) -> tuple[NDArray[np.uint8], NDArray[np.uint32]]:
    """Descriptors of three looks of each landmark."""
    rng = np.random.default_rng(seed)
    own = rng.uniform(0, 100, (landmarks, 128))
    looks = np.repeat(own, 3, axis=0) + rng.normal(size=(3 * landmarks, 128)) * 8
    return np.clip(looks, 0, 255).astype(np.uint8), np.repeat(np.arange(landmarks, dtype=np.uint32), 3)


def by_hand(
    words: VisualWords,
    descriptors: NDArray[np.uint8],
    landmark: NDArray[np.uint32],
    asked: NDArray[np.uint8],
    wanted: NDArray[np.bool_],
    lists: int,
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    of_look = words.list_of(descriptors, words.words_of(descriptors))
    rows, distances = [], []
    for descriptor, probed in zip(asked, words.lists_near(asked, lists), strict=True):
        looks = np.flatnonzero(np.isin(of_look, probed) & wanted[landmark])
        apart = np.linalg.norm(descriptors[looks].astype(float) - descriptor, axis=1)
        rows.append(int(landmark[looks[apart.argmin()]]))
        distances.append(apart.min())
    return np.array(rows), np.array(distances)


@pytest.mark.parametrize("lists", [1, 4, EVERY])
def test_the_nearest_of_the_lists(lists: int) -> None:
    descriptors, landmark = some_looks(3000)
    words = VisualWords.learn(descriptors)
    index = LandmarkIndex(words, descriptors, landmark)
    index.add(np.arange(len(descriptors)))
    asked = some_looks(3000, 1)[0][::50] // 2 + descriptors[::50] // 2
    wanted = np.random.default_rng(2).uniform(size=3000) < 0.6
    rows, best, rival = index.nearest(asked, lists, np.flatnonzero(wanted[landmark]))
    expected, distances = by_hand(words, descriptors, landmark, asked, wanted, lists)
    np.testing.assert_array_equal(rows, expected)
    np.testing.assert_allclose(best, distances)
    assert (rival > best).all()


@pytest.mark.parametrize("above", [0, 200, 10**6])
def test_looks_that_come_later_are_found_as_if_they_had_been_there(monkeypatch: pytest.MonkeyPatch, above: int) -> None:
    monkeypatch.setattr(landmark_index, "_SORTED_IN_ABOVE", above)
    descriptors, landmark = some_looks(2000)
    words = VisualWords.learn(descriptors[:3000])
    table = np.zeros_like(descriptors)
    growing, whole = (LandmarkIndex(words, table, landmark) for _ in range(2))
    for looks in np.array_split(np.arange(len(table)), 13):
        table[looks] = descriptors[looks]
        growing.add(looks)
    whole.add(np.arange(len(table)))
    for a, b in zip(*(index.nearest(descriptors[::40], 8) for index in (growing, whole)), strict=True):
        np.testing.assert_array_equal(a, b)
    # A slot whose look is replaced is found by its new look.
    table[30:33] = some_looks(1, 7)[0]
    growing.add(np.arange(30, 33))
    rows, best, _ = growing.nearest(table[30:33], 8)
    assert rows.tolist() == [10, 10, 10] and best.max() == 0.0
