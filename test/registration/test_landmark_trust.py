"""How far landmarks are trusted, against fading all of them in every image."""

import numpy as np
import pytest

from bodycam_ros.registration import landmark_trust
from bodycam_ros.registration.landmark_trust import LandmarkTrust


@pytest.mark.parametrize("least_scale", [1e-12, 0.5])
def test_trust_is_that_of_fading_every_landmark(monkeypatch: pytest.MonkeyPatch, least_scale: float) -> None:
    monkeypatch.setattr(landmark_trust, "_LEAST_SCALE", least_scale)
    random = np.random.default_rng(0)
    trust, expected = LandmarkTrust(200, 0.2), np.full(200, 0.5)
    for _ in range(1000):
        rows = random.choice(200, 30, replace=False)
        found = random.uniform(size=30) < rows / 200
        trust.learn(rows, found)
        expected += 0.002 * (0.5 - expected)
        expected[rows] += 0.2 * (found - expected[rows])
    np.testing.assert_allclose(0.5 + trust.scale * trust.scaled, expected, atol=1e-5)
    assert np.ptp(expected) > 0.8


def test_an_hour_of_images_overflows_nothing() -> None:
    trust = LandmarkTrust(3, 0.2)
    row = np.zeros(1, np.int64)
    for _ in range(110_000):
        trust.learn(row, np.ones(1, bool))
    assert 0.49 < trust.scale * trust.scaled[0] <= 0.5
    assert trust.scaled[1] == 0.0
