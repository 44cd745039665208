"""Cameras that run freely, with clocks that are off: the calibration finds by how much, and the body all the same."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
from helpers.range_of_motion import (
    joints_in_cameras,
    known_body,
    known_rig,
    range_of_motion,
    registrations,
    wide_cameras,
)

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.calibration.body_calibrator import BodyCalibrator
from bodycam_ros.registration.landmark_matches import LandmarkMatches

RATE_HZ = 24.0
AHEAD_S = {"shin_left": 0.02, "forearm_left": -0.013, "thigh_right": 0.006}


def free_running(body: BodyModel, ahead_s: Mapping[str, float], pixel_noise: float = 0.0) -> list[LandmarkMatches]:
    """A range of motion by cameras of which each takes its images at times of its own."""
    phases_s = np.random.default_rng(8).uniform(0.0, 1.0 / RATE_HZ, len(body.mounts))
    images = []
    for camera, phase_s in zip(body.mounts, phases_s, strict=True):
        motion = range_of_motion(body, duration_s=8.0, rate_hz=RATE_HZ, delay_s=float(phase_s))
        shift_ns = round(1e9 * ahead_s.get(camera, 0.0))
        images += [
            replace(one, stamp_ns=one.stamp_ns + shift_ns) for one in registrations(motion, pixel_noise, only=[camera])
        ]
    return sorted(images, key=lambda one: one.stamp_ns)


def test_clocks_of_free_running_cameras_are_found() -> None:
    """Eight seconds of slow motion by few joints: clocks to 2.5 ms, joints to 4 mm."""
    body = known_body()
    calibrator = BodyCalibrator(known_rig(body), wide_cameras(body.mounts))
    for one in free_running(body, AHEAD_S, pixel_noise=0.3):
        calibrator.add(one)
    found = calibrator.solve()
    for camera in found.diagnosis.cameras:
        assert camera.clock_s == pytest.approx(AHEAD_S.get(camera.camera, 0.0), abs=2.5e-3), camera.camera
    truth = joints_in_cameras(body)
    errors_m = [np.linalg.norm(place - truth[key]) for key, place in joints_in_cameras(found.body).items()]
    assert max(errors_m) < 4e-3
