"""Visual words: what is alike has one word, and its list is among the few that are searched."""

import numpy as np
import pytest
from numpy.typing import NDArray

from bodycam_ros.registration.visual_words import VisualWords


def clusters(count: int, of_each: int, seed: int = 0) -> NDArray[np.uint8]:
    """Descriptors of some kinds, one kind after the other."""
    rng = np.random.default_rng(seed)
    kinds = rng.uniform(0, 100, (count, 128))
    return np.clip(np.repeat(kinds, of_each, axis=0) + rng.normal(size=(count * of_each, 128)) * 6, 0, 255).astype(
        np.uint8
    )


def nearest(vectors: NDArray[np.uint8], centres: NDArray[np.float32]) -> NDArray[np.int64]:
    return np.array([np.argmin(np.linalg.norm(centres - vector.astype(float), axis=1)) for vector in vectors])


@pytest.mark.parametrize("of_each", [100, 400])
def test_each_descriptor_is_listed_under_what_is_nearest(of_each: int) -> None:
    descriptors = clusters(120, of_each)
    words = VisualWords.learn(descriptors)
    assert words.centres.shape == (64, 128)
    some = descriptors[::97]
    word = words.words_of(some)
    np.testing.assert_array_equal(word, nearest(some, words.centres))
    fine = words.fine.shape[1]
    assert fine == round(120 * of_each / (64 * 80))
    lists = words.list_of(some, word)
    expected = [w * fine + nearest(d[None], words.fine[w])[0] for d, w in zip(some, word, strict=True)]
    np.testing.assert_array_equal(lists, expected)
    assert lists.max() < words.lists


def test_the_lists_that_are_searched_hold_what_is_most_alike() -> None:
    descriptors = clusters(120, 400)
    words = VisualWords.learn(descriptors)
    lists = words.list_of(descriptors, words.words_of(descriptors))
    asked = clusters(120, 1)
    probed = words.lists_near(asked, 16)
    assert probed.shape == (120, 16)
    shares = [np.isin(lists[400 * kind : 400 * (kind + 1)], probed[kind]).mean() for kind in range(120)]
    assert np.mean(shares) > 0.98
    assert all(len(set(row)) == 16 for row in probed.tolist())
