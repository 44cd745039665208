"""Order of frames, unanswered frames, lost and dropped messages. Without ROS."""

from collections.abc import Iterable

import pytest

from bodycam_ros.live import unanswered_frames
from bodycam_ros.live.dropped_messages import DroppedMessages, LostMessages
from bodycam_ros.live.stamp_order import StampOrder
from bodycam_ros.live.unanswered_frames import UnansweredFrames


class Clock:
    """Time that passes when the test says so."""

    now_s = 100.0

    def monotonic(self) -> float:
        return self.now_s


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    clock = Clock()
    monkeypatch.setattr(unanswered_frames, "time", clock)
    return clock


def test_a_tracker_waits_when_it_is_too_far_ahead(clock: Clock) -> None:
    frames = UnansweredFrames()
    assert not frames.must_wait(2)
    frames.add(10)
    assert not frames.must_wait(2)
    frames.add(20)
    assert frames.must_wait(2)
    frames.answer(10)
    assert not frames.must_wait(2)


def test_without_answers_the_tracker_goes_on_alone(clock: Clock) -> None:
    frames = UnansweredFrames()
    frames.add(10)
    clock.now_s += 1.9
    assert frames.must_wait(1)
    clock.now_s += 0.2
    assert not frames.must_wait(1)
    for stamp_ns in (20, 30, 40):
        frames.add(stamp_ns)
        assert not frames.must_wait(1), "not for every few frames again"
    assert frames.answer(30), "somebody is there again"
    assert frames.must_wait(1)


def test_a_new_reader_need_not_answer_for_the_one_before(clock: Clock) -> None:
    frames = UnansweredFrames()
    frames.add(10)
    assert frames.must_wait(1)
    frames.expect_no_answer()
    assert not frames.must_wait(1)
    frames.add(20)
    assert not frames.must_wait(1)
    assert frames.answer(20)
    frames.add(30)
    assert frames.must_wait(1), "from its first answer on it is waited for"


def test_a_slow_registration_is_waited_for_as_long_as_it_answers(clock: Clock) -> None:
    frames = UnansweredFrames()
    for number in range(10):
        frames.add(number)
        frames.add(number)
        clock.now_s += 1.5
        assert frames.must_wait(2)
        frames.answer(number)


def test_the_chain_of_stamps_shows_what_is_missing() -> None:
    lost = LostMessages()
    assert not lost.add("head", 20, 10), "whatever came before the first message is not missed"
    assert not lost.add("head", 30, 20)
    assert not lost.add("foot", 30, 20), "each camera has a chain of its own"
    assert lost.add("head", 50, 40)
    assert not lost.add("head", 60, 50)
    assert not lost.add("head", 70, 0), "a tracker that started again has no predecessor"


def test_the_first_of_a_kind_is_told_and_all_are_counted() -> None:
    told: list[str] = []
    dropped = DroppedMessages(told.append)
    for reason in ("a grey one", "a green one"):
        dropped.add("images", reason)
    dropped.add("messages", "a short one")
    assert dropped.counts == {"images": 2, "messages": 1}
    assert [line.split(" (")[0] for line in told] == ["a grey one", "a short one"]
    assert (dropped.count_new(), dropped.count_new()) == (3, 0)
    assert dropped.latest == "a short one"


def ordered(stamps: Iterable[int], strays: list[str]) -> list[tuple[int, bool]]:
    """(stamp [ms], whether time begins anew there) of what is in order."""
    order: StampOrder[int] = StampOrder(strays.append)
    found = []
    for stamp in stamps:
        in_order, goes_back = order.add(stamp * 1_000_000, stamp)
        found += [(each, goes_back and each == in_order[0]) for each in in_order]
    return found


@pytest.mark.parametrize("stray", [3_600_000, 3_600_000_000, 1, 66])
def test_one_stray_stamp_silences_nobody(stray: int) -> None:
    strays: list[str] = []
    before, after = list(range(33, 1000, 33)), list(range(1023, 2000, 33))
    assert ordered([*before, stray, *after], strays) == [(stamp, False) for stamp in before + after]
    assert len(strays) == 1 and "stamp" in strays[0]


def test_time_that_goes_back_begins_anew_and_loses_nothing() -> None:
    strays: list[str] = []
    stamps = list(range(33, 1000, 33))
    again = [(33, True), *((stamp, False) for stamp in stamps[1:])]
    assert ordered([*stamps, *stamps, *stamps], strays) == [(stamp, False) for stamp in stamps] + again + again
    assert not strays


def test_a_stream_that_paused_goes_on() -> None:
    strays: list[str] = []
    stamps = [33, 66, 5000, 5033, 5066]
    assert ordered(stamps, strays) == [(stamp, False) for stamp in stamps] and not strays


def test_two_players_of_one_camera_are_not_mixed() -> None:
    strays: list[str] = []
    stamps = [stamp for k in range(1, 30) for stamp in (50_000 + 33 * k, 10_000 + 33 * k)]
    assert ordered(stamps, strays) == [(50_000 + 33 * k, False) for k in range(1, 30)]
