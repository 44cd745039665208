"""Clocks of inertial sensors against each other, by samples of a body of which everything is known."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
from range_of_motion import known_body, range_of_motion

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.geometry import log_so3
from bodycam_ros.inertial.imu_calibration import ImuCalibration
from bodycam_ros.inertial.imu_samples import GRAVITY, ImuSamples
from bodycam_ros.timing.inertial_clocks import camera_clocks

RATE_HZ = 200.0
BODY = known_body()
AHEAD_S = {camera: 0.004 * (number % 7 - 3) for number, camera in enumerate(BODY.mounts)}


@pytest.fixture(scope="module")
def imus() -> Mapping[str, ImuSamples]:
    """Samples with noise and biases of consumer sensors, by clocks that are off."""
    motion, random = range_of_motion(BODY, duration_s=20.0, rate_hz=RATE_HZ), np.random.default_rng(3)
    samples = {}
    for camera, poses in motion.world_T_camera.items():
        R, inner = poses[:, :3, :3], slice(1, -1)
        turned = log_so3(np.swapaxes(R[:-2], 1, 2) @ R[2:])
        w = 0.5 * RATE_HZ * turned + 0.002 * random.normal(size=turned.shape) + 0.01 * random.normal(size=3)
        acceleration = RATE_HZ**2 * np.diff(poses[:, :3, 3], 2, axis=0) + [0.0, 0.0, GRAVITY]
        a = (acceleration[:, None] @ R[inner])[:, 0] + 0.03 * random.normal(size=w.shape) + 0.05 * random.normal(size=3)
        stamps_ns = motion.stamps_ns[inner] + round(1e9 * AHEAD_S[camera])
        smooth = motion.stamps_ns[inner] > motion.stamps_ns[0] + 2_200_000_000  # it starts with a jerk
        samples[camera] = ImuSamples(stamps_ns[smooth], w[smooth], a[smooth])
    return samples


def with_sensors(delays_s: Mapping[str, float]) -> BodyModel:
    """The body with sensors at its cameras, late by some times [s]."""
    mounts = {
        camera: replace(mount, imu=ImuCalibration(time_offset=delays_s.get(camera, 0.0), time_offset_sigma=1e-4))
        for camera, mount in BODY.mounts.items()
    }
    return replace(BODY, mounts=mounts)


def test_clocks_agree_to_a_millisecond_where_joints_move(imus: Mapping[str, ImuSamples]) -> None:
    clocks = camera_clocks(with_sensors({}), imus)
    assert len(clocks) > 1
    reference = next(iter(clocks))
    assert clocks[reference].offset == 0.0
    for camera, clock in clocks.items():
        error_s = clock.offset - (AHEAD_S[camera] - AHEAD_S[reference])
        assert abs(error_s) < max(0.001, 3.0 * clock.sigma) and clock.sigma < 0.004, camera


def test_delays_of_sensors_are_taken_out_of_the_cameras_clocks(imus: Mapping[str, ImuSamples]) -> None:
    clocks = camera_clocks(with_sensors(AHEAD_S), imus)
    assert len(clocks) > 1
    assert all(abs(clock.offset) < max(0.001, 3.0 * clock.sigma) for clock in clocks.values())
    assert camera_clocks(BODY, imus) == {}


def test_sensors_at_rest_have_no_clock() -> None:
    rest = ImuSamples(np.arange(0, 10**10, 5 * 10**6, dtype=np.int64), np.zeros((2000, 3)), np.full((2000, 3), 5.66))
    assert camera_clocks(with_sensors({}), dict.fromkeys(BODY.mounts, rest)) == {}
