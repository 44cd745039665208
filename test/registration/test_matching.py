"""The search of the whole map, against asking every pair."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from bodycam_ros.registration import matching
from bodycam_ros.registration.matching import MatchingSettings, match_everywhere


def some_map(rng: np.random.Generator, landmarks: int) -> Any:
    """Landmarks with one to four looks each; every tenth looks like the one before it."""
    looks = rng.integers(1, 5, landmarks)
    own = rng.integers(0, 90, (landmarks, 128))
    own[10::10] = own[9:-1:10]
    landmark = np.repeat(np.arange(landmarks, dtype=np.uint32), looks)
    noise = rng.integers(-8, 9, (len(landmark), 128))
    return SimpleNamespace(
        descriptor_landmark=landmark, descriptors=np.clip(own[landmark] + noise, 0, 255).astype(np.uint8), own=own
    )


def every_pair(reference_map: Any, descriptors: np.ndarray, every_view: bool) -> list[tuple[int, int]]:
    """Feature and landmark of what is near enough and unambiguous, before two features share a landmark."""
    settings = MatchingSettings()
    landmark = reference_map.descriptor_landmark.astype(int)
    rows = np.arange(len(landmark)) if every_view else np.unique(landmark, return_index=True)[1]
    pairs = []
    for feature, descriptor in enumerate(descriptors.astype(float)):
        distances = np.linalg.norm(reference_map.descriptors[rows] - descriptor, axis=1)
        best = distances.argmin()
        rivals = distances[landmark[rows] != landmark[rows][best]]
        if distances[best] < settings.max_distance_lost and distances[best] < settings.ratio * rivals.min():
            pairs.append((feature, int(landmark[rows][best])))
    return pairs


@pytest.mark.parametrize("every_view", [False, True])
@pytest.mark.parametrize("block", [1, 64, 10**6])
def test_blocks_find_what_every_pair_tells(monkeypatch: pytest.MonkeyPatch, every_view: bool, block: int) -> None:
    monkeypatch.setattr(matching, "_BLOCK", block)
    rng = np.random.default_rng(3)
    reference_map = some_map(rng, 300)
    asked = np.concatenate([np.arange(0, 300, 4), np.arange(9, 100, 10), np.arange(10, 100, 10)])
    descriptors = (reference_map.own[asked] + rng.integers(0, 8, (len(asked), 128))).astype(np.uint8)
    descriptors[::7] = rng.integers(0, 90, descriptors[::7].shape)
    feature, landmark = match_everywhere(reference_map, descriptors, every_view, MatchingSettings())
    expected = every_pair(reference_map, descriptors, every_view)
    assert 30 < len(expected) < len(asked) - 20
    assert set(zip(feature.tolist(), landmark.tolist(), strict=True)) <= set(expected)
    assert set(landmark.tolist()) == {each for _, each in expected}
