"""Gyroscopes against solved cameras: one that measures what its camera did, and one that is off by a known rate."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from helpers.known_walk import START_NS, Walk, write_solved
from matplotlib.image import imread

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.evaluate.camera_figures import gyroscope_residuals, sensor_figures
from bodycam_ros.evaluate.evaluation import evaluate
from bodycam_ros.evaluate.time_panels import draw_sensors
from bodycam_ros.geometry import log_so3
from bodycam_ros.inertial.imu_calibration import ImuCalibration
from bodycam_ros.inertial.imu_samples import GRAVITY, ImuSamples
from bodycam_ros.messages.imu import IMU_TOPIC, imu_message
from bodycam_ros.recording.bag_writer import write_recording
from bodycam_ros.recording.typestore import recorded_messages
from bodycam_ros.results.solved_recording import SolvedRecording, read_solved

OFF = {"waist": np.zeros(3), "shin": np.array([0.0, 0.2, 0.0])}  # [rad/s]


@pytest.fixture(scope="module")
def calibrated(solved: Path) -> SolvedRecording:
    recording = read_solved(solved)
    return replace(recording, body=with_sensors(recording.body))


def with_sensors(body: BodyModel) -> BodyModel:
    mounts = {name: replace(mount, imu=ImuCalibration()) for name, mount in body.mounts.items()}
    return replace(body, mounts=mounts)


def samples_of(walk: Walk, camera: str) -> ImuSamples:
    """240 a second, turning as the camera does, by a known rate too fast."""
    mount = walk.body.mounts[camera]
    R = (walk.world_T_segment[:, walk.body.segment_index[mount.segment]] @ mount.segment_T_camera)[:, :3, :3]
    rates = log_so3(np.swapaxes(R[:-1], 1, 2) @ R[1:]) / (1e-9 * np.diff(walk.stamps_ns)[:, None])
    stamps_ns = np.linspace(walk.stamps_ns[0], walk.stamps_ns[-1], 8 * len(rates), endpoint=False).astype(np.int64)
    w = np.repeat(rates, 8, axis=0) + OFF[camera]
    return ImuSamples(stamps_ns, w, np.tile([0.0, -GRAVITY, 0.0], (len(w), 1)))


def test_residuals_are_what_a_gyroscope_is_off(calibrated: SolvedRecording, walk: Walk, tmp_path: Path) -> None:
    sensors = {camera: samples_of(walk, camera) for camera in OFF}
    residuals = gyroscope_residuals(calibrated, sensors)
    for camera, off in OFF.items():
        np.testing.assert_allclose(np.median(residuals[camera].rad_s, axis=0), off, atol=0.02)
        assert 0.0 < residuals[camera].seconds.min() and residuals[camera].seconds.max() < 2.0
    figures = sensor_figures(sensors, residuals)
    assert figures["shin"].bias_change_deg_s == pytest.approx(np.degrees(0.2), abs=1.0)
    assert figures["waist"].bias_change_deg_s < 1.0
    draw_sensors(residuals, tmp_path / "sensors.png")
    picture = imread(tmp_path / "sensors.png")
    height, width = picture.shape[:2]
    upper, lower = (picture[round(share * height), width // 2, :3].mean() for share in (0.4, 0.65))
    assert upper > lower  # the waist's row is paler than the shin's


def test_sensors_without_a_calibration_have_no_residual(solved: Path, walk: Walk) -> None:
    sensors = {"waist": samples_of(walk, "waist")}
    recording = read_solved(solved)
    assert gyroscope_residuals(recording, sensors) == {}
    assert np.isnan(sensor_figures(sensors, {})["waist"].residual_deg_s)


@pytest.mark.parametrize("count", [1, 99, 200])
def test_a_sensor_with_few_samples_is_left_out(walk: Walk, tmp_path: Path, count: int) -> None:
    solved = write_solved(replace(walk, body=with_sensors(walk.body)), tmp_path / "out")
    samples, make = samples_of(walk, "waist"), recorded_messages()
    with write_recording(tmp_path / "imu") as writer:
        for row in range(count):
            stamp_ns = START_NS + 5_000_000 * row
            sample = samples.angular_velocity[row], samples.acceleration[row]
            writer.write(f"/waist{IMU_TOPIC}", stamp_ns, imu_message(make, "waist", stamp_ns, *sample))
    evaluation = evaluate(solved, imu_paths=[tmp_path / "imu"])
    assert (evaluation.figures.sensors is not None) == (set(evaluation.gyroscopes) == {"waist"}) == (count >= 100)
