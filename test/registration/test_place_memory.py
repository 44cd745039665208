"""Places: a picture is most like those that show the same things."""

from pathlib import Path

import numpy as np
import pytest

from bodycam_ros.registration.place_memory import PlaceMemory
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.registration.visual_words import VisualWords


@pytest.fixture(scope="module")
def reference_map(sample: Path) -> ReferenceMap:
    """The sample's map."""
    return ReferenceMap.load(sample / "map")


def test_half_of_a_place_is_most_like_the_whole() -> None:
    rng = np.random.default_rng(0)
    pictures = rng.integers(0, 90, (150, 60, 128)).astype(np.uint8)
    places = PlaceMemory(VisualWords.learn(pictures.reshape(-1, 128)))
    for number, picture in enumerate(pictures):
        places.add(picture, np.array([number, number + 1]))
    assert len(places) == 150
    for number in range(0, 150, 7):
        other = pictures[(number + 1) % 150]
        mixed = np.concatenate([pictures[number, :40], other[40:]])
        similar = places.similar(
            np.clip(mixed.astype(int) + rng.integers(-3, 4, mixed.shape), 0, 255).astype(np.uint8), 2
        )
        assert similar.tolist() == [number, (number + 1) % 150]
    assert places.seen_from(np.array([9, 4, 3])).tolist() == [3, 4, 5, 9, 10]
    assert len(places.similar(pictures[0], 1000)) == 150
    assert places.similar(pictures[0][:0], 3).shape == (3,)
