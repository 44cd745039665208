"""What diagnostics say of a camera that does not go with the others."""

import pytest

from bodycam_ros.messages.health import timing_health
from bodycam_ros.messages.status import HealthLevel, few
from bodycam_ros.solving.synchrony import Timing

NAN = float("nan")


@pytest.mark.parametrize(
    "timing, silent, apart_s, level, told",
    [
        (Timing(1.0, 0.0, 0.5), False, 0.03, HealthLevel.OK, "in time"),
        (Timing(0.0, 12.0, 0.5), False, 0.0, HealthLevel.WARN, "12.0 ms after the others"),
        (Timing(0.0, -12.0, 0.5), False, 0.0, HealthLevel.WARN, "12.0 ms before the others"),
        (Timing(0.4, 1.0, 30.0), False, 0.0, HealthLevel.WARN, "wander"),
        (Timing(0.5, 0.0, 0.0), False, 0.0, HealthLevel.WARN, "misses instants; speaks of 50% of the instants"),
        (Timing(0.0, NAN, NAN), True, None, HealthLevel.ERROR, "says nothing"),
        (Timing(0.0, NAN, NAN), True, -3600.0, HealthLevel.ERROR, "3600.0 s behind the others'"),
        (Timing(0.0, NAN, NAN), False, 3600.0, HealthLevel.ERROR, "3600.0 s ahead of the others'"),
    ],
)
def test_a_camera_that_is_off_is_named(
    timing: Timing, silent: bool, apart_s: float | None, level: HealthLevel, told: str
) -> None:
    health = timing_health("head", timing, tolerance_s=0.008, late=3, silent=silent, apart_s=apart_s)
    assert (health.name, health.level) == ("camera head", level)
    assert told in health.text
    assert health.values["late registrations"] == 3


def test_a_line_stays_a_line() -> None:
    assert few([]) == ""
    assert few(["a", "b", "c"]) == "a, b, c"
    assert few(["a", "b", "c", "d", "e"]) == "a, b, c and 2 more"
