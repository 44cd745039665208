"""What is said of the clocks that a replay corrected."""

import math

from bodycam_ros.replay.clock_remarks import clock_remarks
from bodycam_ros.timing.clock_history import ClockHistory
from bodycam_ros.timing.clock_state import ClockJump, ClockState

START_NS = 1_700_000_000_000_000_000
SPEEDS = {"toe": (math.radians(40.0), 0.5)}


def clock(offset_s: float, sigma_s: float, since_ns: int = START_NS, drift: float = 0.0) -> ClockState:
    return ClockState(since_ns, since_ns, offset_s, drift, sigma_s, 1e-5)


def remarks(*clocks: ClockState, jumps: tuple[ClockJump, ...] = ()) -> tuple[str, ...]:
    return clock_remarks({"toe": ClockHistory("toe", clocks)}, jumps, SPEEDS)


def test_a_clock_that_is_right_is_not_spoken_of() -> None:
    assert remarks(clock(0.0, 0.0002)) == ()
    assert remarks(clock(0.004, 0.0025)) == ()


def test_a_clock_that_was_off_is_named_with_its_size() -> None:
    assert remarks(clock(0.0201, 0.0019)) == ("camera toe: its clock was 20.1 ms ahead (+-1.9); corrected",)
    (line,) = remarks(clock(-0.013, 0.0019, drift=9.7e-5))
    assert line == "camera toe: its clock was 13.0 ms behind (+-1.9), and drifted by +97 ppm; corrected"


def test_a_clock_that_was_set_is_named_with_the_time_and_the_size() -> None:
    jump_ns = START_NS + 3_100_000_000
    lines = remarks(clock(0.0, 0.001), clock(0.05, 0.001, jump_ns), jumps=(ClockJump("toe", jump_ns, 0.05),))
    assert lines == ("camera toe: its clock jumped by +50 ms after 3.1 s; corrected",)


def test_a_clock_that_stays_unknown_is_named_with_what_it_may_cost() -> None:
    assert remarks(clock(0.0, 0.009)) == (
        "camera toe: its clock is known to 9 ms only, for it hardly moved: up to 9 mm and 0.7 deg may be left",
    )
    (line,) = clock_remarks({"knee": ClockHistory("knee", (clock(0.0, 0.009),))}, (), SPEEDS)
    assert line.endswith("for it hardly moved")
