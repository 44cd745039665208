"""The turn of a camera between images by its gyroscope, against the motion that the readings were made from."""

import numpy as np
import pytest

from bodycam_ros.geometry import Array, exp_so3, log_so3
from bodycam_ros.inertial.camera_turn import CameraTurn
from bodycam_ros.inertial.imu_calibration import ImuCalibration
from bodycam_ros.inertial.imu_samples import ImuSamples
from bodycam_ros.tracking.camera_motion import CameraMotion

START_NS = 10**9
SECONDS = 30.0
RATE_HZ = 200
STEP_S = 0.0005
IMAGE_NS = 200_000_000
TURN_ON = np.array([8e-4, -6e-4, 5e-4])  # [rad/s] of the bias since the calibration
CALIBRATION = ImuCalibration(
    camera_R_imu=exp_so3(np.array([0.3, -1.2, 0.7])),
    time_offset=0.004,
    gyro_bias=np.array([0.01, -0.008, 0.005]),
    gyro_scale=np.array([1.01, 0.99, 1.005]),
)


def rates(t: Array) -> Array:
    """(T, 3) of a swinging camera, along its own axes [rad/s]."""
    return np.column_stack([4.0 * np.sin(5.0 * t), 2.0 * np.cos(3.0 * t), 1.5 * np.sin(7.0 * t + 1.0)])


@pytest.fixture(scope="module")
def orientations() -> Array:
    """(N, 3, 3) of the camera in the world, every ``STEP_S``."""
    t = STEP_S * (np.arange(round(SECONDS / STEP_S)) + 0.5)
    R = [np.eye(3)]
    for turn in exp_so3(STEP_S * rates(t)):
        R.append(R[-1] @ turn)
    return np.array(R)


def readings(turn_on: Array | float = 0.0) -> ImuSamples:
    """Samples of the sensor, by its own clock and along its own axes."""
    t = np.arange(round(SECONDS * RATE_HZ)) / RATE_HZ
    w = rates(t) @ CALIBRATION.camera_R_imu * CALIBRATION.gyro_scale + CALIBRATION.gyro_bias + turn_on
    stamps_ns = START_NS + np.rint(1e9 * (t + CALIBRATION.time_offset)).astype(np.int64)
    return ImuSamples(stamps_ns, w, np.zeros((len(t), 3)))


def worst_deg(turn: CameraTurn, orientations: Array, first: int) -> float:
    """Largest error of the turns since the image before, from an image on; each image is registered afterwards."""
    errors = []
    for number in range(1, 140):
        start_ns, end_ns = (START_NS + each * IMAGE_NS for each in (number - 1, number))
        before, after = (orientations[round(1e-9 * each * IMAGE_NS / STEP_S)] for each in (number - 1, number))
        measured = turn.between(start_ns, end_ns)
        if number >= first:
            assert measured is not None
            errors.append(np.degrees(np.linalg.norm(log_so3(measured @ before.T @ after))))
        pose = np.eye(4)
        pose[:3, :3] = after
        turn.observe(end_ns, pose[:3, :3])
    return max(errors)


def test_images_at_five_a_second_turn_as_the_camera_did(orientations: Array) -> None:
    # Readings are linear between samples, of a camera that swings: 0.02 deg. At constant velocity it errs by degrees.
    assert worst_deg(CameraTurn(CALIBRATION, readings()), orientations, 5) < 0.02


def test_registered_images_correct_the_bias(orientations: Array) -> None:
    # Left alone it would add 0.01 rad/s * 0.2 s = 0.13 deg to each turn.
    assert worst_deg(CameraTurn(CALIBRATION, readings(10.0 * TURN_ON)), orientations, 100) < 0.04


def test_no_turn_without_samples_or_of_a_sensor_that_contradicts_the_images(orientations: Array) -> None:
    samples = readings()
    assert CameraTurn(CALIBRATION, samples).between(START_NS - IMAGE_NS, START_NS + IMAGE_NS) is None
    exchanged = ImuSamples(samples.stamps_ns, samples.angular_velocity[:, [1, 0, 2]], samples.acceleration)
    turn = CameraTurn(CALIBRATION, exchanged)
    for number in range(1, 60):
        pose = np.eye(4)
        pose[:3, :3] = orientations[round(1e-9 * number * IMAGE_NS / STEP_S)]
        turn.observe(START_NS + number * IMAGE_NS, pose[:3, :3])
    assert turn.between(START_NS + 60 * IMAGE_NS, START_NS + 61 * IMAGE_NS) is None


def test_the_twist_inside_an_image_is_the_gyroscopes(orientations: Array) -> None:
    """Poses a tenth of a second apart do not tell how fast a limb turns while rows are read out."""
    turn, motion = CameraTurn(CALIBRATION, readings()), CameraMotion()
    errors = []
    for number in range(1, 100):
        stamp_ns, passed_ns = START_NS + number * IMAGE_NS // 2, IMAGE_NS // 2
        pose = np.eye(4)
        pose[:3, :3] = orientations[round(1e-9 * (stamp_ns - START_NS) / STEP_S)]
        by_turn = turn.angular_velocity(stamp_ns)
        if number > 5:
            assert by_turn is not None
            in_image = [
                motion.in_image(stamp_ns, stamp_ns - passed_ns, None, 0.012, measured) for measured in (by_turn, None)
            ]
            true = rates(1e-9 * np.array([stamp_ns - START_NS]))[0]
            errors.append([np.linalg.norm(each.twist_of(pose)[:3] - true) for each in in_image if each])
        motion = motion.with_pose(stamp_ns, pose, stamp_ns - passed_ns)
        turn.observe(stamp_ns, pose[:3, :3])
    by_gyroscope, by_poses = np.mean(errors, axis=0)
    assert by_gyroscope < 0.02 < 0.2 < by_poses
