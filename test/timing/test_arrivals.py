"""Streams of single cameras become frames of the body, whatever the order of arrival."""

from collections.abc import Iterable

import numpy as np
import pytest

from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.timing.arrivals import Arrivals, CameraArrivals
from bodycam_ros.timing.frame_assembler import AssemblerSettings

MS = 1_000_000
HOUR = 3_600_000


def heard(camera: str, stamp_ms: int) -> LandmarkMatches:
    """A registration of which only camera and stamp matter."""
    return LandmarkMatches(
        camera, stamp_ms * MS, 0, np.zeros(0, np.uint32), np.zeros(0, np.uint32), np.zeros((0, 2), np.float32),
        np.zeros((0, 3), np.float32), None, np.zeros((6, 6)), np.eye(3), 0,
    )  # fmt: skip


def frames_of(messages: list[LandmarkMatches], cameras: str, **settings: float) -> list[tuple[int, str]]:
    """(stamp [ms], cameras) of all frames, those of the flush included."""
    arrivals = Arrivals(cameras, AssemblerSettings(**settings))
    return fed(arrivals, messages) + named(arrivals.flush())


def fed(arrivals: Arrivals, messages: Iterable[LandmarkMatches]) -> list[tuple[int, str]]:
    """(stamp [ms], cameras) of the frames that messages complete."""
    return [frame for message in messages for frame in named(arrivals.add(message))]


def named(frames: Iterable[object]) -> list[tuple[int, str]]:
    return [(frame.stamp_ns // MS, "".join(sorted(frame.matches))) for frame in frames]


def spoken(cameras: str, stamps: Iterable[int]) -> list[LandmarkMatches]:
    """All cameras at each stamp."""
    return [heard(camera, stamp) for stamp in stamps for camera in cameras]


def test_frames_do_not_depend_on_the_order_of_arrival() -> None:
    by_time = spoken("abc", (0, 33, 66))
    by_camera = [heard(camera, stamp) for camera in "abc" for stamp in (0, 33, 66)]
    assert frames_of(by_time, "abc") == frames_of(by_camera, "abc") == [(0, "abc"), (33, "abc"), (66, "abc")]


def test_stamps_within_the_tolerance_are_one_instant() -> None:
    messages = [heard("a", 0), heard("b", 5), heard("a", 33), heard("b", 50)]
    assert frames_of(messages, "ab") == [(0, "ab"), (33, "a"), (50, "b")]


def test_a_camera_that_dies_is_waited_for_once() -> None:
    arrivals = Arrivals("abc", AssemblerSettings(max_wait=0.2))
    assert len(fed(arrivals, spoken("abc", range(0, 100, 20)))) == 5
    waited = {}
    for stamp in range(100, 1000, 20):
        for camera in "ab":
            waited |= {frame[0]: stamp - frame[0] for frame in fed(arrivals, [heard(camera, stamp)])}
    assert waited[100] == 220, "it is waited for"
    assert arrivals.silent == ["c"]
    assert {waited[stamp] for stamp in range(320, 980, 20)} == {20}, "but not again"

    # It speaks again, and is waited for again.
    assert fed(arrivals, [heard("a", 1000), heard("b", 1000), heard("c", 1000)])[-1] == (1000, "abc")
    assert arrivals.silent == []
    assert fed(arrivals, [heard("a", 1020), heard("b", 1020)]) == []
    assert fed(arrivals, [heard("c", 1020)]) == [(1020, "abc")]
    assert arrivals.late == 0


@pytest.mark.parametrize("order", ["abcd", "dcba", "bdac"])
def test_a_pause_of_a_camera_gives_the_same_frames_in_any_order_within_an_instant(order: str) -> None:
    messages = [
        heard(camera, stamp)
        for stamp in range(0, 4000, 33)
        for camera in order
        if camera != "c" or not 990 < stamp < 2970
    ]
    expected = [(stamp, "abd" if 990 < stamp < 2970 else "abcd") for stamp in range(0, 4000, 33)]
    assert frames_of(messages, "abcd") == expected


def test_a_camera_that_lags_but_speaks_is_waited_for() -> None:
    """A busy machine: one camera is processed 1.6 s later than the others, and catches up in a burst."""
    stamps = list(range(0, 3000, 33))
    messages = []
    for number, stamp in enumerate(stamps):
        messages += spoken("ab", [stamp])
        messages += [heard("c", stamps[number - 50])] if number >= 50 else []
    messages += [heard("c", stamp) for stamp in stamps[-50:]]
    assert frames_of(messages, "abc", max_wait=2.0) == [(stamp, "abc") for stamp in stamps]


def test_live_a_busy_machine_makes_nobody_silent(monkeypatch: pytest.MonkeyPatch) -> None:
    now_s = 50.0
    monkeypatch.setattr("time.monotonic", lambda: now_s)
    arrivals = Arrivals("ab", live=True)
    assert fed(arrivals, [heard("a", stamp) for stamp in range(0, 2000, 40)]) == [], "two seconds in no time"
    now_s += 0.9
    assert fed(arrivals, [heard("b", 0), heard("b", 40)]) == [(0, "ab"), (40, "ab")]
    assert fed(arrivals, [heard("a", stamp) for stamp in range(2000, 4000, 40)]) == []
    assert arrivals.complete() == []
    now_s += 1.1
    assert named(arrivals.complete())[-1] == (3960, "a"), "but now it is"
    assert fed(arrivals, [heard("a", 4000)]) == [(4000, "a")], "and nothing waits for it"


def test_a_camera_that_starts_late_is_waited_for() -> None:
    arrivals = Arrivals("abc")
    assert fed(arrivals, spoken("ab", range(HOUR, HOUR + 900, 40))) == []
    assert fed(arrivals, [heard("c", HOUR)]) == [(HOUR, "abc")]


def test_an_image_that_is_lost_at_200_hz_moves_no_other_to_its_state() -> None:
    cameras = "abcdefghijklmnop"
    messages = [m for m in spoken(cameras, range(0, 100, 5)) if (m.camera, m.stamp_ns) != ("c", 50 * MS)]
    arrivals = Arrivals(cameras)
    frames = fed(arrivals, messages) + named(arrivals.flush())
    assert frames == [(stamp, cameras.replace("c", "" if stamp == 50 else "c")) for stamp in range(0, 100, 5)]
    assert arrivals.late == 0


def test_after_a_pause_of_all_cameras_none_has_stopped() -> None:
    arrivals = Arrivals("ab")
    frames = fed(arrivals, spoken("ab", [*range(0, 400, 40), *range(3400, 3800, 40)]))
    assert frames == [(stamp, "ab") for stamp in (*range(0, 400, 40), *range(3400, 3800, 40))]


def test_an_image_that_comes_after_its_frame_is_late_and_counted_over_all_epochs() -> None:
    arrivals = Arrivals("abc", AssemblerSettings(max_wait=0.2))
    fed(arrivals, [*spoken("abc", range(0, 100, 20)), *spoken("ab", range(100, 1000, 20))])
    assert fed(arrivals, [heard("c", stamp) for stamp in (100, 120)]) == []
    fed(arrivals, spoken("abc", range(HOUR, HOUR + 100, 20)))
    assert (arrivals.epoch, arrivals.late) == (1, 2)
    assert arrivals.cameras()["c"] == CameraArrivals(10 / 55, 2, False, 0.0)


def test_what_waits_at_the_end_of_an_epoch_leaves_before_the_next_which_may_be_earlier() -> None:
    arrivals = Arrivals("ab")
    messages = [*spoken("ab", [HOUR, HOUR + 40]), heard("a", HOUR + 80), *spoken("ab", range(0, 400, 40))]
    frames = [frame for message in messages for frame in arrivals.add(message)]
    assert named(frames) == [
        *((HOUR + stamp, "ab") for stamp in (0, 40)),
        (HOUR + 80, "a"),
        *((stamp, "ab") for stamp in range(0, 400, 40)),
    ]
    assert [frame.stamp_ns for frame in frames if frame.is_earlier] == [0]
    assert (arrivals.epoch, arrivals.late, arrivals.frames) == (1, 0, len(frames))


def test_after_a_pause_of_a_recording_time_goes_on() -> None:
    arrivals = Arrivals("ab")
    messages = spoken("ab", [*range(0, 400, 40), *range(HOUR, HOUR + 400, 40)])
    frames = [frame for message in messages for frame in arrivals.add(message)]
    assert named(frames) == [(message.stamp_ns // MS, "ab") for message in messages[::2]]
    assert arrivals.epoch == 1 and not any(frame.is_earlier for frame in frames)


def test_images_up_to_a_state_that_was_solved_without_any_are_late() -> None:
    arrivals = Arrivals("ab")
    fed(arrivals, spoken("ab", [0, 40]))
    assert named([arrivals.frame_without_images(80 * MS)]) == [(80, "")]
    assert fed(arrivals, spoken("ab", [80, 120])) == [(120, "ab")]
    assert arrivals.late == 2


@pytest.mark.parametrize(("max_wait_s", "late"), [(1.0, 0), (3.0, 1)])
def test_a_longer_wait_reaches_cameras_that_are_further_behind(max_wait_s: float, late: int) -> None:
    """12 s behind it is late within five times the wait, and beyond that of another time."""
    arrivals = Arrivals("ab", AssemblerSettings(max_wait=1.0))
    fed(arrivals, spoken("ab", [0, 40]))
    arrivals.set_max_wait(max_wait_s)
    fed(arrivals, [*(heard("a", stamp) for stamp in range(80, 12000, 40)), heard("b", 80)])
    assert arrivals.late == late
