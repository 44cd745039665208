"""Flow control between tracker and registration, on a clock that the test advances."""

import pytest

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


def test_after_time_went_back_nothing_is_unanswered(clock: Clock) -> None:
    frames = UnansweredFrames()
    for stamp_ns in (10, 20):
        frames.add(stamp_ns)
    assert frames.must_wait(2) and frames.answered_since_s is None
    frames.answer(10)
    assert frames.answered_since_s == clock.now_s
    frames.clear()
    assert not frames.must_wait(1) and frames.answered_since_s is None
    assert not frames.answer(20), "an answer from before counts for nothing"


def test_an_answer_to_a_later_frame_answers_those_before_it(clock: Clock) -> None:
    frames = UnansweredFrames()
    for stamp_ns in (10, 20, 30):
        frames.add(stamp_ns)
    assert not frames.answer(25), "there is no such frame"
    assert frames.must_wait(3)
    assert frames.answer(20)
    assert frames.must_wait(1) and not frames.must_wait(2)
