"""What diagnostics say of a camera that does not go with the others."""

import numpy as np

from bodycam_ros.messages.health import RegistrationHealth
from bodycam_ros.messages.status import HealthLevel
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.registration.readout_pool import ReadoutSettings


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
