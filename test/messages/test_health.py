"""What diagnostics say of a camera that does not go with the others."""

import pytest

from bodycam_ros.messages.health import timing_health
from bodycam_ros.messages.status import HealthLevel, few
from bodycam_ros.timing.camera_timing import CameraTiming
from bodycam_ros.timing.clock_state import ClockState


def timing(offset_s: float, sigma_s: float = 0.001) -> CameraTiming:
    return CameraTiming("head", (ClockState(0, 0, offset_s, 0.0, sigma_s, 1e-5),))


@pytest.mark.parametrize(
    "share, silent, apart_s, clock, level, told",
    [
        (1.0, False, 0.03, None, HealthLevel.OK, "in time"),
        (1.0, False, 0.03, timing(0.0021), HealthLevel.OK, "in time"),
        (1.0, False, 0.0, timing(0.012), HealthLevel.OK, "its clock is 12.0 ms ahead of the others', and corrected"),
        (1.0, False, 0.0, timing(-0.012), HealthLevel.OK, "its clock is 12.0 ms behind the others', and corrected"),
        (0.5, False, 0.0, None, HealthLevel.WARN, "misses instants; speaks of 50% of the instants"),
        (0.0, True, None, None, HealthLevel.ERROR, "says nothing"),
        (0.0, True, -3600.0, None, HealthLevel.ERROR, "3600.0 s behind the others'"),
        (0.0, False, 3600.0, timing(0.012), HealthLevel.ERROR, "3600.0 s ahead of the others'"),
    ],
)
def test_a_camera_that_is_off_is_named(
    share: float, silent: bool, apart_s: float | None, clock: CameraTiming | None, level: HealthLevel, told: str
) -> None:
    health = timing_health("head", share, late=3, silent=silent, apart_s=apart_s, timing=clock)
    assert (health.name, health.level) == ("camera head", level)
    assert told in health.text
    assert health.values["late registrations"] == 3


def test_what_is_known_of_a_clock_is_said_in_figures() -> None:
    state = ClockState(0, 0, 0.0201, -3.2e-5, 0.0004, 4e-6)
    told = {
        "clock ahead by [ms]": 20.1,
        "clock sigma [ms]": 0.4,
        "clock drift [ppm]": -32.0,
        "clock drift sigma [ppm]": 4.0,
    }
    health = timing_health("head", 1.0, 0, False, 0.0, CameraTiming("head", (state,)))
    assert told.items() <= health.values.items()


def test_a_line_stays_a_line() -> None:
    assert few([]) == ""
    assert few(["a", "b", "c"]) == "a, b, c"
    assert few(["a", "b", "c", "d", "e"]) == "a, b, c and 2 more"
