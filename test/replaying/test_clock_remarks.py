"""What is printed of clocks: what was promised is kept silently, and one kind of remark is one line."""

import pytest

from bodycam_ros.replaying.replay_remarks import clock_remarks
from bodycam_ros.timing.clock_state import ClockHistory, ClockState


def clock(camera: str, offset_s: float, sigma_s: float = 0.001) -> ClockHistory:
    return ClockHistory(camera, (ClockState(0, 0, offset_s, 0.0, sigma_s, 1e-6),))


def test_offsets_within_three_of_the_recorded_sigmas_are_not_printed() -> None:
    timings = {"head": clock("head", 0.019), "foot": clock("foot", 0.06)}
    (remark,) = clock_remarks(timings, {}, expected_s=0.017)
    assert remark == "camera foot: clock offset +60.0 +- 1.0 ms, corrected"
    assert len(clock_remarks(timings, {})) == 2, "of cameras that a driver stamps together, both are news"


def test_clocks_that_stay_unknown_are_one_line() -> None:
    timings = {name: clock(name, 0.0, sigma_s) for name, sigma_s in (("head", 0.006), ("torso", 0.008))}
    (remark,) = clock_remarks(timings, {"head": (0.1, 0.5), "torso": (0.2, 0.25)})
    assert remark.startswith("the clocks of 2 cameras are known to 8 ms only, because they hardly moved")
    assert remark.endswith("errors of up to 6 mm and 0.2 deg may be left")


@pytest.mark.parametrize("count", [0, 1])
def test_one_clock_or_none(count: int) -> None:
    remarks = clock_remarks({"head": clock("head", 0.0, 0.006)} if count else {}, {})
    assert [remark.split(" is ")[0] for remark in remarks] == ["the clock of camera head"] * count
