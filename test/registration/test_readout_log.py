"""What a recording teaches of read-out times: whom it pools, and what it names."""

import numpy as np
from rolling_camera import wide_camera

from bodycam_ros.camera.readout import Readout
from bodycam_ros.geometry import exp_se3
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.registration.readout_log import ReadoutLog
from bodycam_ros.registration.readout_pool import ReadoutSettings

STEP_NS = 40_000_000
CAMERAS = {name: wide_camera() for name in ("left", "right", "waist")}


def said(camera: str, number: int, readout: Readout, twist: np.ndarray | None) -> LandmarkMatches:
    """An image of a camera of a constant twist, which is lost without one."""
    none = np.zeros(0, np.uint32)
    pose = None if twist is None else exp_se3(1e-9 * STEP_NS * number * twist)
    return LandmarkMatches(
        camera, (number + 1) * STEP_NS, number * STEP_NS, none, none, np.zeros((0, 2), np.float32),
        np.zeros((0, 3), np.float32), pose, np.eye(6), np.eye(3), 0, None, readout.seconds, readout.sigma,
    )  # fmt: skip


def logged(readouts: dict[str, Readout], known: tuple[str, ...] = ()) -> ReadoutLog:
    log = ReadoutLog(CAMERAS, ReadoutSettings(), known)
    for number in range(20):
        lost = None if number == 10 else np.array([0.5, 0.0, 0.0, 0.0, 0.2, 0.0])
        for camera, readout in readouts.items():
            log.add(said(camera, number, readout, lost))
    return log


def test_who_is_doubtful_is_named_with_what_it_may_cost() -> None:
    log = logged({"waist": Readout(0.004, 0.01)})
    assert list(log.doubts()) == ["waist"]
    # Ten milliseconds at 0.2 m/s and 0.5 rad/s; the lost image between costs no speed.
    assert "may leave 2.0 mm and 0.29 deg" in log.doubts()["waist"]
    assert "camera waist" in log.doubts()["waist"]
