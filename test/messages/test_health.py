"""What diagnostics say of a camera that does not go with the others."""

import numpy as np
import pytest
from held_ride import OFF, report

from bodycam_ros.geometry import exp_se3
from bodycam_ros.messages.health import RegistrationHealth, equipment_health, timing_health
from bodycam_ros.messages.status import HealthLevel, few
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.registration.readout_pool import ReadoutSettings
from bodycam_ros.timing.clock_history import ClockHistory
from bodycam_ros.timing.clock_state import ClockState


def timing(offset_s: float, sigma_s: float = 0.001) -> ClockHistory:
    return ClockHistory("head", (ClockState(0, 0, offset_s, 0.0, sigma_s, 1e-5),))


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
    share: float, silent: bool, apart_s: float | None, clock: ClockHistory | None, level: HealthLevel, told: str
) -> None:
    health = timing_health("head", share, missed=7, late=3, silent=silent, apart_s=apart_s, timing=clock)
    assert (health.name, health.level) == ("camera head", level)
    assert told in health.text
    assert (health.values["late registrations"], health.values["instants missed"]) == (3, 7)


def moving_at(twist: np.ndarray, readout_sigma: float) -> RegistrationHealth:
    """Thirty images of a camera of a constant twist."""
    health = RegistrationHealth(["head"], ReadoutSettings())
    none = np.zeros(0, np.uint32)
    for number in range(30):
        health.add(LandmarkMatches(
            "head", (number + 1) * 40_000_000, number * 40_000_000, none, none, np.zeros((0, 2), np.float32),
            np.zeros((0, 3), np.float32), exp_se3(0.04 * number * twist), np.eye(6), np.eye(3), 0, None, 0.012,
            readout_sigma,
        ))  # fmt: skip
    return health


def test_a_readout_time_is_said_and_what_a_doubtful_one_may_cost() -> None:
    twist = np.array([0.0, 2.0, 0.0, 1.5, 0.0, 0.0])
    (told,) = moving_at(twist, 0.0004).report()
    assert told.values["read-out time [ms]"] == "12.0 +- 0.4"
    assert "read-out time" not in told.values
    (told,) = moving_at(twist, 0.004).report()
    # Four milliseconds at 1.5 m/s and 2 rad/s.
    assert "may leave 6.0 mm and 0.46 deg" in told.values["read-out time"]
    assert "Give readout_time in its lens YAML" in told.values["read-out time"]
    (given,) = moving_at(twist, 0.0).report()
    assert given.values["read-out time [ms]"] == "12.0 given"


def test_what_is_known_of_a_clock_is_said_in_figures() -> None:
    state = ClockState(0, 0, 0.0201, -3.2e-5, 0.0004, 4e-6)
    told = {
        "clock ahead by [ms]": 20.1,
        "clock sigma [ms]": 0.4,
        "clock drift [ppm]": -32.0,
        "clock drift sigma [ppm]": 4.0,
    }
    health = timing_health("head", 1.0, 0, 0, False, 0.0, ClockHistory("head", (state,)))
    assert told.items() <= health.values.items()


def test_a_line_stays_a_line() -> None:
    assert few([]) == ""
    assert few(["a", "b", "c"]) == "a, b, c"
    assert few(["a", "b", "c", "d", "e"]) == "a, b, c and 2 more"


def test_the_report_says_what_a_camera_knew_of_where_it_was() -> None:
    health = RegistrationHealth(["head"], ReadoutSettings())
    for grown, registered, turning in [(0, True, 9), (4, True, 9), (0, False, 9), (0, False, 0), (0, True, 0)]:
        ids = np.arange(4, dtype=np.uint32)
        health.add(
            LandmarkMatches(
                "head", 2, 1, ids, ids, np.zeros((4, 2), np.float32), np.zeros((4, 3), np.float32),
                np.eye(4) if registered else None, np.eye(6), np.eye(3), turning, grown=grown,
            )
        )  # fmt: skip
    (report,) = health.report()
    shares = {name: value for name, value in report.values.items() if name.endswith("[%]")}
    assert shares == {"registered [%]": 40, "relative [%]": 20, "rotation only [%]": 20, "blind [%]": 20}
    assert report.level is HealthLevel.WARN and "registered on 60%" in report.text


def test_equipment_says_what_holds() -> None:
    health = equipment_health(report(30))
    assert (health.name, health.level) == ("equipment bicycle", HealthLevel.OK)
    assert health.text == "held: pedal_left; let go: bar"
    assert health.values == {"pedal_left [mm]": 1.3, "bar [mm]": 3000.0, "length crank_x [mm]": "167.0 +- 0.6"}
    off = equipment_health(report(OFF[0]))
    assert (off.level, off.text) == (HealthLevel.WARN, "held: nothing; let go: pedal_left, bar")
    assert equipment_health(report(0)).text == "it is not known where it is; nothing holds to it"
