"""What diagnostics say of a camera that does not go with the others."""

import numpy as np
import pytest

from bodycam_ros.messages.health import RegistrationHealth, timing_health
from bodycam_ros.messages.status import HealthLevel
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
