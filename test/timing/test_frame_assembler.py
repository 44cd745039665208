"""Streams of single cameras become frames of the body, whatever the order of arrival."""

from collections.abc import Iterable

import numpy as np
import pytest

from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.timing.frame_assembler import AssemblerSettings, FrameAssembler

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
    assembler = FrameAssembler(cameras, AssemblerSettings(**settings))
    return fed(assembler, messages) + named(assembler.flush())


def fed(assembler: FrameAssembler, messages: Iterable[LandmarkMatches]) -> list[tuple[int, str]]:
    """(stamp [ms], cameras) of the frames that messages complete."""
    return [frame for message in messages for frame in named(assembler.add(message))]


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
    assembler = FrameAssembler("abc", AssemblerSettings(max_wait=0.2))
    assert len(fed(assembler, spoken("abc", range(0, 100, 20)))) == 5
    waited = {}
    for stamp in range(100, 1000, 20):
        for camera in "ab":
            waited |= {frame[0]: stamp - frame[0] for frame in fed(assembler, [heard(camera, stamp)])}
    assert waited[100] == 220, "it is waited for"
    assert assembler.silent == ["c"]
    assert {waited[stamp] for stamp in range(320, 980, 20)} == {20}, "but not again"

    # It speaks again, and is waited for again.
    assert fed(assembler, [heard("a", 1000), heard("b", 1000), heard("c", 1000)])[-1] == (1000, "abc")
    assert assembler.silent == []
    assert fed(assembler, [heard("a", 1020), heard("b", 1020)]) == []
    assert fed(assembler, [heard("c", 1020)]) == [(1020, "abc")]
    assert assembler.late == 0


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
    assembler = FrameAssembler("ab", live=True)
    assert fed(assembler, [heard("a", stamp) for stamp in range(0, 2000, 40)]) == [], "two seconds in no time"
    now_s += 0.9
    assert fed(assembler, [heard("b", 0), heard("b", 40)]) == [(0, "ab"), (40, "ab")]
    assert fed(assembler, [heard("a", stamp) for stamp in range(2000, 4000, 40)]) == []
    assert assembler.complete() == []
    now_s += 1.1
    assert named(assembler.complete())[-1] == (3960, "a"), "but now it is"
    assert fed(assembler, [heard("a", 4000)]) == [(4000, "a")], "and nothing waits for it"


def test_a_camera_that_starts_late_is_waited_for() -> None:
    assembler = FrameAssembler("abc")
    assert fed(assembler, spoken("ab", range(HOUR, HOUR + 900, 40))) == []
    assert fed(assembler, [heard("c", HOUR)]) == [(HOUR, "abc")]


def test_an_image_that_is_lost_at_200_hz_moves_no_other_to_its_state() -> None:
    cameras = "abcdefghijklmnop"
    messages = [m for m in spoken(cameras, range(0, 100, 5)) if (m.camera, m.stamp_ns) != ("c", 50 * MS)]
    assembler = FrameAssembler(cameras)
    frames = fed(assembler, messages) + named(assembler.flush())
    assert frames == [(stamp, cameras.replace("c", "" if stamp == 50 else "c")) for stamp in range(0, 100, 5)]
    assert assembler.late == 0


def test_after_a_pause_of_all_cameras_none_has_stopped() -> None:
    assembler = FrameAssembler("ab")
    frames = fed(assembler, spoken("ab", [*range(0, 400, 40), *range(3400, 3800, 40)]))
    assert frames == [(stamp, "ab") for stamp in (*range(0, 400, 40), *range(3400, 3800, 40))]


def test_a_new_epoch_may_be_earlier() -> None:
    assembler = FrameAssembler("ab")
    fed(assembler, spoken("ab", range(HOUR, HOUR + 400, 40)))
    assembler.restart()
    assert fed(assembler, spoken("ab", range(0, 400, 40))) == [(stamp, "ab") for stamp in range(0, 400, 40)]
    assert assembler.late == 0
