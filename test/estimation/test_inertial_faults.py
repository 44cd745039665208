"""Inertial sensors that are late, stop, or keep another time are named with their cameras."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from helpers.registered_pose import registered_pose
from helpers.two_cameras import write_body

from bodycam_ros.body.body_file import read_body
from bodycam_ros.body_state import BodyFrame
from bodycam_ros.estimation.inertial_factors import InertialSensors, InertialSettings
from bodycam_ros.inertial.imu_calibration import ImuCalibration
from bodycam_ros.inertial.imu_samples import GRAVITY

START_NS = 10**12
FRAME_NS = 33_333_333
SAMPLE_NS = 5_000_000


@pytest.mark.parametrize(
    ("off_s", "stops_s", "up", "fault"),
    [
        (0.0, 9.0, GRAVITY, ""),
        (0.004, 9.0, GRAVITY, ""),
        (3600.0, 9.0, GRAVITY, "no samples at the time of the images"),
        (-0.1, 9.0, GRAVITY, "no samples at the time of the images"),
        (0.0, 1.5, GRAVITY, "no samples at"),
        (0.0, 9.0, 1.0, "by its accelerometer"),  # in g
    ],
)
def test_a_sensor_that_is_late_stops_or_has_another_unit_is_named(
    tmp_path: Path, off_s: float, stops_s: float, up: float, fault: str
) -> None:
    """Samples arrive with the images; their stamps are off by so much, or they end."""
    body = read_body(write_body(tmp_path / "body.yaml"))
    mounts = {camera: replace(mount, imu=ImuCalibration()) for camera, mount in body.mounts.items()}
    sensors = InertialSensors(replace(body, mounts=mounts), InertialSettings())
    assert sensors.faults() == {} and sensors.in_use == []
    sample = 0
    for frame in range(90):
        stamp_ns = START_NS + frame * FRAME_NS
        while sample * SAMPLE_NS <= frame * FRAME_NS + SAMPLE_NS:
            at_ns = START_NS + sample * SAMPLE_NS
            sensors.add_sample("right", at_ns, (0.0, 0.0, 0.0, 0.0, 0.0, GRAVITY))
            if sample * SAMPLE_NS < 1e9 * stops_s:
                sensors.add_sample("left", at_ns + round(1e9 * off_s), (0.0, 0.0, 0.0, 0.0, 0.0, up))
            sample += 1
        matches = {camera: registered_pose(camera, stamp_ns, stamp_ns - FRAME_NS, np.eye(4)) for camera in mounts}
        sensors.observe(BodyFrame(stamp_ns, matches))
    assert "right" in sensors.in_use and "right" not in sensors.faults()
    assert fault in sensors.faults().get("left", "") and ("left" in sensors.faults()) == bool(fault)
    assert all(remark.startswith("camera left: its inertial sensor ") for remark in sensors.remarks())
