"""The search of a map by descriptors alone, against asking every pair."""

from pathlib import Path

import numpy as np
import pytest

from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.registration.relocalisation import match_by_descriptors


@pytest.fixture(scope="module")
def reference_map(sample: Path) -> ReferenceMap:
    """The sample's map."""
    return ReferenceMap.load(sample / "map")


@pytest.fixture(scope="module")
def descriptors(reference_map: ReferenceMap) -> np.ndarray:
    """Looks of the map, disturbed as another view would, some of them beyond recognition."""
    rng = np.random.default_rng(3)
    looks = reference_map.descriptors[rng.choice(len(reference_map.descriptors), 250, replace=False)].astype(float)
    noise = rng.normal(size=looks.shape) * rng.uniform(2.0, 24.0, (len(looks), 1))
    return np.clip(np.rint(looks + noise), 0, 255).astype(np.uint8)


def every_pair(reference_map: ReferenceMap, descriptors: np.ndarray) -> set[tuple[int, int]]:
    """Feature and landmark of what is near enough and unambiguous, before two features share a landmark."""
    landmark, looks = reference_map.descriptor_landmark.astype(int), reference_map.descriptors.astype(float)
    pairs = set()
    for feature, descriptor in enumerate(descriptors.astype(float)):
        distances = np.sqrt((looks**2).sum(axis=1) - 2.0 * looks @ descriptor + descriptor @ descriptor)
        best = distances.argmin()
        rivals = distances[landmark != landmark[best]]
        if distances[best] < 240.0 and distances[best] < 0.85 * rivals.min():
            pairs.add((feature, int(landmark[best])))
    return pairs


def test_a_search_finds_nearly_all_that_every_pair_tells(reference_map, descriptors) -> None:
    expected = every_pair(reference_map, descriptors)
    found = match_by_descriptors(reference_map, descriptors)
    pairs = set(zip(found[0].tolist(), found[1].tolist(), strict=True))
    assert 60 < len(expected) < 240
    # What is in no list that was searched is not found; nor is a rival, so some are believed that would not be.
    assert len(pairs & expected) > 0.95 * len(expected)
    assert len(pairs - expected) < 0.06 * len(expected) + 1
    assert len(set(found[1].tolist())) == len(found[1])
