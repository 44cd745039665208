"""The time of most cameras."""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import pytest

from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.timing.timeline import Timeline

MS = 1_000_000
HOUR = 3_600_000


def image(camera: str, stamp_ms: int) -> LandmarkMatches:
    """A registration of which only camera and stamp matter."""
    return LandmarkMatches(
        camera, stamp_ms * MS, 0, np.zeros(0, np.uint32), np.zeros(0, np.uint32), np.zeros((0, 2), np.float32),
        np.zeros((0, 3), np.float32), None, np.zeros((6, 6)), np.eye(3), 0,
    )  # fmt: skip


def admitted(timeline: Timeline, images: Iterable[tuple[str, int]]) -> list[tuple[str, int]]:
    """Camera and stamp [ms] of the images that a timeline admits."""
    return [
        (each.camera, each.stamp_ns // MS) for camera, stamp in images for each in timeline.admit(image(camera, stamp))
    ]


def together(cameras: str, stamps: Iterable[int]) -> list[tuple[str, int]]:
    return [(camera, stamp) for stamp in stamps for camera in cameras]


@pytest.mark.parametrize("again", [0, 1500, HOUR])
@pytest.mark.parametrize("cameras", ["a", "ab", "abcd"])
def test_a_bag_that_is_played_again_is_a_new_epoch_from_its_first_image_on(cameras: str, again: int) -> None:
    """From its beginning, its middle, or another bag; the cameras go there one after the other."""
    timeline = Timeline(1.0)
    first = together(cameras, range(0, 2000, 40))
    assert admitted(timeline, first) == first
    crossing = []
    for turn in range(8):
        for number, camera in enumerate(cameras):
            is_back = turn >= 1 + number
            crossing.append((camera, again + 40 * (turn - 1 - number) if is_back else 2000 + 40 * turn))
    second = admitted(timeline, crossing + together(cameras, range(again + 320, again + 2000, 40)))
    assert timeline.epoch == 1
    for camera in cameras:
        stamps = [stamp for name, stamp in second if name == camera]
        moved = stamps.index(again)
        assert stamps[moved:] == sorted(set(stamps[moved:])) and stamps[-1] == again + 1960


def test_a_camera_that_dies_has_no_vote_on_the_time() -> None:
    timeline = Timeline(1.0)
    admitted(timeline, together("abcd", range(0, 2000, 40)))
    admitted(timeline, together("ab", range(2000, 6000, 40)))
    assert admitted(timeline, together("ab", range(0, 400, 40)))[:2] == [("a", 0), ("b", 0)]
    assert timeline.epoch == 1


@pytest.mark.parametrize("off", [HOUR, -HOUR])
@pytest.mark.parametrize("cameras", ["abcd", "dabc"])
def test_a_clock_that_was_never_set_costs_the_others_nothing(off: int, cameras: str) -> None:
    """Not even where it is the first."""
    timeline = Timeline(1.0)
    images = [
        (camera, stamp + (off if camera == "d" else 0)) for camera, stamp in together(cameras, range(0, 4000, 40))
    ]
    shown = admitted(timeline, [(camera, 2 * HOUR + stamp) for camera, stamp in images])
    assert len([camera for camera, _ in shown if camera != "d"]) == 300
    assert len([camera for camera, _ in shown if camera == "d"]) <= 8
    assert timeline.apart_s("d") == pytest.approx(1e-3 * off, abs=0.1)
    assert timeline.apart_s("a") == pytest.approx(0.0, abs=0.1)
    admitted(timeline, together("abc", range(2 * HOUR + 4000, 2 * HOUR + 8000, 40)))
    assert timeline.apart_s("d") is None, "it stopped"


def test_a_camera_that_has_not_followed_the_others_to_a_new_epoch_has_no_offset_yet() -> None:
    timeline = Timeline(1.0)
    admitted(timeline, together("abcd", range(0, 2000, 40)))
    admitted(timeline, together("bcd", range(HOUR, HOUR + 120, 40)))
    assert timeline.epoch == 1
    assert timeline.apart_s("a") is None
    assert timeline.apart_s("b") == pytest.approx(0.0, abs=0.1)


def test_images_out_of_order_begin_no_epoch() -> None:
    timeline = Timeline(1.0)
    assert admitted(timeline, [("a", 0), ("a", 80), ("a", 40), ("a", 120)]) == [("a", 0), ("a", 80), ("a", 120)]
    assert timeline.epoch == 0


def alone(stamps: Iterable[int]) -> list[int]:
    """What is admitted of the stamps [ms] of a camera alone."""
    return [stamp for _, stamp in admitted(Timeline(2.0), together("a", stamps))]


@pytest.mark.parametrize("stray", [HOUR, 1000 * HOUR, 1, 66])
def test_one_stray_stamp_silences_nobody(stray: int) -> None:
    before, after = list(range(33, 1000, 33)), list(range(1023, 2000, 33))
    assert alone([*before, stray, *after]) == before + after


def test_images_of_the_past_that_are_sent_at_once_are_no_time_that_begins_anew() -> None:
    timeline = Timeline(2.0)
    assert admitted(timeline, together("a", [33, 66, 1000])) == together("a", [33, 66, 1000])
    past = image("a", 40)
    assert not any(timeline.admit(replace(past, stamp_ns=past.stamp_ns + number)) for number in range(4))
    assert timeline.epoch == 0


def test_time_that_goes_back_begins_anew_and_loses_nothing() -> None:
    stamps = list(range(33, 1000, 33))
    assert alone(3 * stamps) == 3 * stamps


def test_a_stream_that_paused_goes_on() -> None:
    stamps = [33, 66, 5000, 5033, 5066]
    assert alone(stamps) == stamps


def test_two_players_of_one_camera_are_not_mixed() -> None:
    stamps = [stamp for k in range(1, 30) for stamp in (50_000 + 33 * k, 10_000 + 33 * k)]
    assert alone(stamps) == [50_000 + 33 * k for k in range(1, 30)]
