"""Cameras on one clock, in bounded memory."""

import numpy as np

from bodycam_ros.calibration.camera_motion import CameraLog, MotionLogSettings, camera_motion
from bodycam_ros.geometry import exp_se3
from bodycam_ros.registration.landmark_matches import LandmarkMatches

VELOCITY = np.array([0.2, -0.5, 0.4, 0.3, 0.1, -0.2])


def pose_at(seconds: float) -> np.ndarray:
    return exp_se3(seconds * VELOCITY)


def matches(camera: str, seconds: float, registered: bool = True) -> LandmarkMatches:
    none = np.zeros(0, np.uint32)
    return LandmarkMatches(
        camera,
        round(1e9 * seconds),
        0,
        none,
        none,
        np.zeros((0, 2), np.float32),
        np.zeros((0, 3), np.float32),
        pose_at(seconds) if registered else None,
        np.eye(6),
        np.eye(3),
        0,
    )


def log(camera: str, times: np.ndarray, settings: MotionLogSettings | None = None) -> CameraLog:
    made = CameraLog(camera, settings or MotionLogSettings())
    for seconds in times:
        made.add(matches(camera, float(seconds)))
    return made


def test_a_camera_between_beats_is_interpolated() -> None:
    beats = np.arange(60) / 30.0
    motion = camera_motion([log("a", beats), log("b", beats[:-1] + 0.013)], MotionLogSettings())
    assert motion.known[:, 0].all()
    assert motion.known[1:-1, 1].all() and not motion.known[0, 1]
    for row in range(1, 58):
        np.testing.assert_allclose(motion.world_T_camera[row, 1], pose_at(beats[row]), atol=1e-9)
        image = motion.matches[row]["b"]
        expected = motion.world_T_camera[row, 1] @ motion.instant_T_image[row, 1]
        np.testing.assert_allclose(expected, pose_at(1e-9 * image.stamp_ns), atol=1e-9)
