"""Parts of a recording by its own time, and the part in which most of its cameras run."""

import math

import pytest

from bodycam_ros.recording.time_span import LATEST_NS, TimeSpan, most_cameras_window

S = 1_000_000_000


def test_a_part_is_counted_from_the_first_image() -> None:
    assert TimeSpan(1.5, 4.0).window_ns(100 * S) == (round(101.5 * S), 104 * S)
    assert TimeSpan(1.0, math.inf).window_ns(100 * S) == (101 * S, LATEST_NS)


def test_cameras_that_start_and_stop_one_by_one() -> None:
    spans = {f"camera_{n}": (n * S, (30 - n) * S) for n in range(8)}
    assert most_cameras_window(spans) == (5 * S, 25 * S + 1)  # six of eight


@pytest.mark.parametrize("end", [3, 20])
def test_one_camera_that_is_late_or_ends_early_cuts_nothing(end: int) -> None:
    spans = {"head": (0, 20 * S), "chest": (0, 20 * S), "shin": (0, 20 * S), "foot": (20 * S - end * S, end * S)}
    assert most_cameras_window(spans) == (0, 20 * S + 1)


def test_cameras_of_two_times_are_all_kept() -> None:
    spans = {"head": (0, 5 * S), "chest": (9 * S, 12 * S), "foot": (9 * S, 12 * S), "shin": (0, 5 * S)}
    assert most_cameras_window(spans) == (0, 12 * S + 1)
