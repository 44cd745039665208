"""What nodes remember about frames on their way: sent, answered, missed, skipped. Without ROS."""

import pytest

from bodycam_ros.nodes import flow_of_frames
from bodycam_ros.nodes.flow_of_frames import AnsweredFrames, MissedFrames, Skipped


class Clock:
    """Time that passes when the test says so."""

    now_s = 100.0

    def monotonic(self) -> float:
        return self.now_s


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    clock = Clock()
    monkeypatch.setattr(flow_of_frames, "time", clock)
    return clock


def test_a_tracker_waits_when_it_is_too_far_ahead(clock: Clock) -> None:
    frames = AnsweredFrames(most_ahead=2)
    assert not frames.must_wait()
    frames.sent(10)
    assert not frames.must_wait()
    frames.sent(20)
    assert frames.must_wait()
    frames.answered(10)
    assert not frames.must_wait()


def test_an_answer_covers_the_frames_before_it(clock: Clock) -> None:
    frames = AnsweredFrames(most_ahead=3)
    for stamp_ns in (10, 20, 30):
        frames.sent(stamp_ns)
    frames.answered(20)
    frames.sent(40)
    assert not frames.must_wait()
    frames.sent(50)
    assert frames.must_wait()


def test_without_answers_the_tracker_goes_on_alone(clock: Clock) -> None:
    frames = AnsweredFrames(most_ahead=1)
    frames.sent(10)
    clock.now_s += 1.9
    assert frames.must_wait()
    clock.now_s += 0.2
    assert not frames.must_wait()


def test_a_slow_registration_is_waited_for_as_long_as_it_answers(clock: Clock) -> None:
    frames = AnsweredFrames(most_ahead=2)
    for number in range(10):
        frames.sent(number)
        frames.sent(number)
        clock.now_s += 1.5
        assert frames.must_wait()
        frames.answered(number)


def test_the_chain_of_stamps_shows_what_is_missing() -> None:
    missed = MissedFrames()
    assert not missed.add("head", 20, 10), "whatever came before the first message is not missed"
    assert not missed.add("head", 30, 20)
    assert not missed.add("foot", 30, 20), "each camera has a chain of its own"
    assert missed.add("head", 50, 40)
    assert not missed.add("head", 60, 50)
    assert not missed.add("head", 70, 0), "a tracker that started again has no predecessor"
    assert missed.count == 1


def test_the_first_of_a_kind_is_told_and_all_are_counted() -> None:
    told: list[str] = []
    skipped = Skipped(told.append)
    for reason in ("a grey one", "a green one"):
        skipped.add("images", reason)
    skipped.add("messages", "a short one")
    assert skipped.counts == {"images": 2, "messages": 1}
    assert [line.split(" (")[0] for line in told] == ["a grey one", "a short one"]
