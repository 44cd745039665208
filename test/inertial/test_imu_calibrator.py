"""A sensor in a camera that swings: rotation, delay, biases and lever arm are those that it was made with."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.naming import naming

from bodycam_ros.body.body_yaml import imu_entry, imu_of
from bodycam_ros.errors import BodyError, RangeOfMotionError
from bodycam_ros.geometry import Array, exp_so3, rigid
from bodycam_ros.inertial.bias_filter import BiasFilter
from bodycam_ros.inertial.imu_calibration import ImuCalibration
from bodycam_ros.inertial.imu_calibrator import RegisteredSensors, calibrate_imu
from bodycam_ros.inertial.imu_samples import GRAVITY, ImuSamples

TRUE = ImuCalibration(
    camera_R_imu=exp_so3(np.array([0.02, -0.6, 1.5])),
    camera_p_imu=np.array([0.01, -0.008, 0.004]),
    time_offset=0.0032,
    gyro_bias=np.array([0.01, -0.02, 0.005]),
    gyro_scale=np.array([1.003, 0.996, 1.001]),
    accelerometer_bias=np.array([0.1, -0.05, 0.02]),
)
SECONDS = 12.0
_H = 1e-4


def camera_poses(t: Array) -> Array:
    """(T, 4, 4) world_T_camera of a camera on a swinging limb."""
    w = np.column_stack([0.7 * np.sin(2.1 * t), 0.5 * np.sin(1.3 * t + 0.4), 0.6 * np.sin(1.7 * t + 1.0)])
    place = np.column_stack([0.3 * np.sin(1.9 * t), 0.2 * np.cos(1.1 * t), 1.0 + 0.15 * np.sin(2.3 * t)])
    return rigid(exp_so3(w), place)


def samples_of(true: ImuCalibration, rng: np.random.Generator) -> ImuSamples:
    t = np.arange(-0.2, SECONDS + 0.2, 0.005)
    before, now, after = (camera_poses(t + h) for h in (-_H, 0.0, _H))
    turned = np.swapaxes(before[:, :3, :3], 1, 2) @ after[:, :3, :3]
    w = np.column_stack(
        [turned[:, 2, 1] - turned[:, 1, 2], turned[:, 0, 2] - turned[:, 2, 0], turned[:, 1, 0] - turned[:, 0, 1]]
    )
    w = 0.5 * w / (2.0 * _H)
    places = [pose[:, :3, :3] @ true.camera_p_imu + pose[:, :3, 3] for pose in (before, now, after)]
    force = (places[0] - 2.0 * places[1] + places[2]) / _H**2 + [0.0, 0.0, GRAVITY]
    a = (np.swapaxes(now[:, :3, :3], 1, 2) @ force[..., None])[..., 0]
    w, a = w @ true.camera_R_imu, a @ true.camera_R_imu
    return ImuSamples(
        np.round(1e9 * (t + true.time_offset)).astype(np.int64) + 10**12,
        w * true.gyro_scale + true.gyro_bias + rng.normal(0.0, 0.003, w.shape),
        a + true.accelerometer_bias + rng.normal(0.0, 0.03, a.shape),
    )


@pytest.fixture(scope="module")
def recorded() -> tuple[np.ndarray, Array, ImuSamples]:
    rng = np.random.default_rng(1)
    t = np.arange(0.0, SECONDS, 1.0 / 30.0)
    poses = camera_poses(t)
    poses[:, :3, :3] = poses[:, :3, :3] @ exp_so3(rng.normal(0.0, 4e-4, (len(t), 3)))
    poses[:, :3, 3] += rng.normal(0.0, 0.001, (len(t), 3))
    return np.round(1e9 * t).astype(np.int64) + 10**12, poses, samples_of(TRUE, rng)


def test_the_sensor_is_found_as_it_is(recorded: tuple[np.ndarray, Array, ImuSamples]) -> None:
    found = calibrate_imu("cam", *recorded)
    apart = found.camera_R_imu.T @ TRUE.camera_R_imu
    assert np.degrees(np.arccos(min(1.0, (np.trace(apart) - 1.0) / 2.0))) < 0.1
    assert abs(found.time_offset - TRUE.time_offset) < 3e-4
    assert np.abs(found.gyro_bias - TRUE.gyro_bias).max() < np.radians(0.02)
    assert np.abs(found.gyro_scale - TRUE.gyro_scale).max() < 1e-3
    assert np.linalg.norm(found.camera_p_imu - TRUE.camera_p_imu) < 0.003
    assert np.abs(found.accelerometer_bias - TRUE.accelerometer_bias).max() < 0.03
    for name in ("rotation", "position", "time_offset", "gyro_bias", "accelerometer_bias"):
        assert 0.0 < getattr(found, f"{name}_sigma") < getattr(ImuCalibration(), f"{name}_sigma")


def test_a_sensor_whose_clock_is_an_hour_off_is_named(recorded: tuple[np.ndarray, Array, ImuSamples]) -> None:
    stamps_ns, poses, samples = recorded
    late = ImuSamples(samples.stamps_ns + 3600 * 10**9, samples.angular_velocity, samples.acceleration)
    with naming(RangeOfMotionError, "camera cam", "0 of 360", "clocks"):
        calibrate_imu("cam", stamps_ns, poses, late)


@pytest.mark.parametrize("wrong", ["degrees", "mirrored", "frozen", "in g"])
def test_a_sensor_that_differs_from_the_images_is_left_out(
    recorded: tuple[np.ndarray, Array, ImuSamples], wrong: str, caplog: pytest.LogCaptureFixture
) -> None:
    stamps_ns, poses, samples = recorded
    w, a = samples.angular_velocity, samples.acceleration
    changed = {"degrees": np.degrees(w), "mirrored": w * [1.0, 1.0, -1.0], "frozen": np.tile(w[:1], (len(w), 1))}
    a = a / GRAVITY if wrong == "in g" else a
    sensors = RegisteredSensors({"cam": ImuSamples(samples.stamps_ns, changed.get(wrong, w), a)})
    for stamp_ns, pose in zip(stamps_ns, poses, strict=True):
        sensors.add("cam", int(stamp_ns), pose)
    assert not sensors.calibrate()
    assert "camera cam" in caplog.text and "not used" in caplog.text


@pytest.mark.parametrize("delay_s", [0.0, 0.006])
def test_bias_and_delay_that_changed_since_are_followed(
    recorded: tuple[np.ndarray, Array, ImuSamples], delay_s: float
) -> None:
    stamps_ns, poses, samples = recorded
    moved = np.array([0.004, -0.003, 0.002])
    followed = BiasFilter(ImuCalibration(gyro_bias_sigma=3e-4))
    bias, offset = TRUE.gyro_bias - moved * TRUE.gyro_scale, TRUE.time_offset - delay_s
    changed = replace(TRUE, gyro_bias=bias, time_offset=offset)
    followed.motion.add(changed.correct(samples))
    for stamp_ns, pose in zip(stamps_ns, poses, strict=True):
        followed.observe(int(stamp_ns), pose[:3, :3])
    assert np.linalg.norm(followed.bias - TRUE.camera_R_imu @ moved) < 4.0 * followed.sigma < np.radians(0.15)
    assert followed.contradicting == 0 < followed.agreeing
    assert followed.delay == (0.0 if delay_s == 0.0 else pytest.approx(delay_s, abs=1e-3))


@pytest.mark.parametrize("wrong", ["degrees", "exchanged", "frozen", "late"])
def test_a_sensor_that_changed_since_the_calibration_is_wrong(
    recorded: tuple[np.ndarray, Array, ImuSamples], wrong: str
) -> None:
    stamps_ns, poses, samples = recorded
    w, late_ns = samples.angular_velocity, 100_000_000 if wrong == "late" else 0
    changed = {"degrees": np.degrees(w), "exchanged": w[:, [1, 0, 2]], "frozen": np.tile(w[:1], (len(w), 1)), "late": w}
    for readings, shift_ns, is_wrong in ((changed[wrong], late_ns, True), (w, 0, False)):
        followed = BiasFilter(ImuCalibration(gyro_bias_sigma=3e-4))
        followed.motion.add(TRUE.correct(ImuSamples(samples.stamps_ns + shift_ns, readings, samples.acceleration)))
        for stamp_ns, pose in zip(stamps_ns, poses, strict=True):
            followed.observe(int(stamp_ns), pose[:3, :3])
        assert followed.is_wrong == is_wrong


def test_a_body_file_keeps_the_calibration() -> None:
    again = imu_of(imu_entry(TRUE), "camera cam: imu")
    for name in vars(TRUE):
        if "noise" not in name:
            np.testing.assert_allclose(getattr(again, name), getattr(TRUE, name), atol=1e-8)
    with naming(BodyError, "camera cam: imu", "scales"):
        imu_of(imu_entry(TRUE) | {"gyro_scale": [1.0, 0.0, 1.0]}, "camera cam: imu")
