"""The clock of a recording: it runs at a rate, stands still, and goes on from there."""

import math

import pytest

from bodycam_ros.live.playback import PlayedTime

START_NS = 1_000_000_000_000


@pytest.fixture
def steady(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """What the steady clock says [s], in the hands of the test."""
    now_s = [100.0]
    monkeypatch.setattr("bodycam_ros.live.playback.time.monotonic", lambda: now_s[0])
    return now_s


def test_it_runs_stands_still_and_goes_on(steady: list[float]) -> None:
    played = PlayedTime(2.0)
    played.go_to(START_NS)
    assert played.left_s(START_NS + 3_000_000_000) == 1.5
    steady[0] += 1.0
    assert played.now_ns == START_NS + 2_000_000_000
    played.pause()
    played.pause()
    steady[0] += 3600.0
    assert played.now_ns == START_NS + 2_000_000_000
    assert played.left_s(START_NS + 3_000_000_000) == math.inf and played.left_s(START_NS + 1_000_000_000) == -0.5
    played.resume()
    played.resume()
    steady[0] += 0.25
    played.set_rate(0.5)
    steady[0] += 1.0
    assert played.now_ns == START_NS + 3_000_000_000
    assert played.left_s(START_NS + 4_000_000_000) == 2.0
