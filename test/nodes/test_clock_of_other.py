"""How far another computer's clock is ahead, by questions and answers over ways of known length."""

import numpy as np
import pytest

from bodycam_ros.nodes.clock_of_other import ClockOfOther

MS = 1_000_000


def ask(clock: ClockOfOther, now_ns: int, ahead_ns: int, there_ns: int, busy_ns: int, back_ns: int) -> None:
    """A question to a clock that is ahead by so much, over a way of so long there and back."""
    heard_ns = now_ns + there_ns + ahead_ns
    clock.add(now_ns, heard_ns, heard_ns + busy_ns, now_ns + there_ns + busy_ns + back_ns)


@pytest.mark.parametrize("ahead_ms", [-70_000.0, -3.0, 0.0, 12.5])
def test_equal_ways_tell_exactly(ahead_ms: float) -> None:
    clock = ClockOfOther(lambda: 0.0)
    # The other is busy for long before it answers: that is no part of the way.
    ask(clock, 10**18, int(ahead_ms * MS), 20 * MS, 300 * MS, 20 * MS)
    assert clock.ahead == pytest.approx((1e-3 * ahead_ms, 0.020))


def test_the_bound_holds_on_ways_that_queue() -> None:
    rng = np.random.default_rng(0)
    for ahead_ms in (-8.0, 0.0, 30.0):
        now_s = [0.0]
        clock = ClockOfOther(lambda now_s=now_s: now_s[0])
        for number in range(20):
            now_s[0] = float(number)
            there_ns, back_ns = (int(MS * (2.0 + rng.exponential(15.0))) for _ in range(2))
            ask(clock, int(1e9 * number), int(ahead_ms * MS), there_ns, 0, back_ns)
        seconds, bound = clock.ahead
        assert abs(seconds - 1e-3 * ahead_ms) <= bound
        assert bound < 0.010, "the best of twenty, and not their mean of 17 ms"


def test_old_answers_give_way() -> None:
    """Clocks that run apart: what was known well an hour ago is no longer."""
    now_s = [0.0]
    clock = ClockOfOther(lambda: now_s[0])
    ask(clock, 0, 0, MS, 0, MS)
    now_s[0] = 3600.0
    ask(clock, 3600 * 10**9, 180 * MS, 40 * MS, 0, 40 * MS)
    assert clock.ahead == pytest.approx((0.180, 0.040))


def test_impossible_times_say_nothing() -> None:
    clock = ClockOfOther(lambda: 0.0)
    clock.add(asked_ns=0, heard_ns=5, told_ns=4, answered_ns=10)
    clock.add(asked_ns=0, heard_ns=0, told_ns=20, answered_ns=10)
    assert clock.ahead is None
