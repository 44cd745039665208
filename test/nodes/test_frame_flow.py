"""Unanswered frames, lost and dropped messages. Without ROS."""

import pytest

from bodycam_ros.diagnostics.dropped_messages import DroppedMessages, LostMessages
from bodycam_ros.graph import unanswered_frames
from bodycam_ros.graph.unanswered_frames import UnansweredFrames


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
