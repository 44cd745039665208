"""Fewer images of a fast recording, the same of all cameras."""

import math

import numpy as np

from bodycam_ros.replay.beat import Beat


def kept(beat: Beat, camera: str, stamps_ns: np.ndarray) -> list[int]:
    return [index for index, stamp in enumerate(stamps_ns) if beat.is_due(camera, int(stamp))]


def test_every_second_image_of_thirty_at_fifteen() -> None:
    stamps = np.round(np.arange(60) * 1e9 / 30).astype(int)
    assert kept(Beat(15.0), "a", stamps) == list(range(0, 60, 2))


def test_jitter_does_not_part_the_cameras() -> None:
    random = np.random.default_rng(1)
    beat = Beat(15.0)
    even = np.arange(120) * 1e9 / 30
    first = kept(beat, "a", even)
    for camera in "bcd":
        assert kept(beat, camera, even + random.uniform(-2e6, 2e6, 120)) == first


def test_a_slow_recording_is_kept_whole() -> None:
    stamps = np.round(np.arange(30) * 1e9 / 10).astype(int)
    assert kept(Beat(15.0), "a", stamps) == list(range(30))


def test_sixty_a_second() -> None:
    stamps = np.round(np.arange(120) * 1e9 / 60).astype(int)
    assert kept(Beat(15.0), "a", stamps) == list(range(0, 120, 4))


def test_infinite_takes_all() -> None:
    assert kept(Beat(math.inf), "a", np.arange(5)) == list(range(5))
