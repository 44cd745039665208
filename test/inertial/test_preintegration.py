"""Motion between two stamps: gtsam's preintegration of the same samples, and first-order corrections by biases."""

import gtsam
import numpy as np
import pytest

from bodycam_ros.geometry import Array, exp_so3
from bodycam_ros.inertial.imu_samples import ImuSamples
from bodycam_ros.inertial.preintegration import SensorMotion, integrate

RATE_HZ, PERIOD_NS = 200, 5_000_000


def swinging(count: int, gyro_bias: Array | float = 0.0, accelerometer_bias: Array | float = 0.0) -> ImuSamples:
    """A limb that swings about changing axes."""
    t = np.arange(count) / RATE_HZ
    w = np.column_stack([3.0 * np.sin(4.0 * t), 2.0 * np.cos(3.0 * t), 1.5 * np.sin(7.0 * t + 1.0)])
    a = np.column_stack([5.0 * np.cos(5.0 * t), 9.8 + 3.0 * np.sin(6.0 * t), 4.0 * np.sin(2.0 * t)])
    return ImuSamples(10**9 + PERIOD_NS * np.arange(count), w + gyro_bias, a + accelerometer_bias)


def motion_of(samples: ImuSamples) -> SensorMotion:
    made = SensorMotion()
    made.add(samples)
    return made


def test_motion_is_gtsams() -> None:
    samples, (start, end) = swinging(400), (37, 301)
    moved = motion_of(samples).between(int(samples.stamps_ns[start]), int(samples.stamps_ns[end]))
    by_gtsam = gtsam.PreintegratedImuMeasurements(
        gtsam.PreintegrationParams.MakeSharedU(0.0), gtsam.imuBias.ConstantBias()
    )
    fine = 20  # gtsam holds a reading for a sample; of readings that are linear it needs many
    for row in range(start, end):
        for share in (np.arange(fine) + 0.5) / fine:
            mixed = [
                values[row] * (1.0 - share) + values[row + 1] * share
                for values in (samples.acceleration, samples.angular_velocity)
            ]
            by_gtsam.integrateMeasurement(*mixed, 1.0 / RATE_HZ / fine)
    assert moved is not None
    np.testing.assert_allclose(moved.rotation, by_gtsam.deltaRij().matrix(), atol=2e-4)
    np.testing.assert_allclose(moved.velocity, by_gtsam.deltaVij(), atol=2e-3)
    np.testing.assert_allclose(moved.position, by_gtsam.deltaPij(), atol=2e-3)


def test_stamps_between_samples_and_samples_in_parts() -> None:
    samples = swinging(400)
    whole, parts = motion_of(samples), SensorMotion()
    for start in range(0, 400, 7):
        parts.add(samples.between(int(samples.stamps_ns[start]), int(samples.stamps_ns[min(start + 6, 399)])))
    start_ns, middle_ns, end_ns = (10**9 + round(1e9 * s) for s in (0.1234, 0.777, 1.5671))
    one, other = whole.between(start_ns, end_ns), parts.between(start_ns, end_ns)
    first, second = whole.between(start_ns, middle_ns), whole.between(middle_ns, end_ns)
    assert one and other and first and second
    np.testing.assert_allclose(one.position, other.position, atol=1e-9)
    np.testing.assert_allclose(one.rotation, first.rotation @ second.rotation, atol=1e-9)
    np.testing.assert_allclose(one.velocity, first.velocity + first.rotation @ second.velocity, atol=1e-9)
    joined = first.position + first.velocity * second.seconds + first.rotation @ second.position
    np.testing.assert_allclose(one.position, joined, atol=1e-9)


@pytest.mark.parametrize("axis", range(3))
def test_biases_are_taken_out_to_first_order(axis: int) -> None:
    bias, end_ns = 1e-4 * np.eye(3)[axis], 10**9 + 600_000_000
    right = motion_of(swinging(200)).between(10**9, end_ns)
    turned = motion_of(swinging(200, gyro_bias=bias)).between(10**9, end_ns)
    pushed = motion_of(swinging(200, accelerometer_bias=bias)).between(10**9, end_ns)
    assert right and turned and pushed
    np.testing.assert_allclose(turned.rotation @ exp_so3(-turned.rotation_by_bias @ bias), right.rotation, atol=1e-7)
    np.testing.assert_allclose(pushed.velocity - pushed.velocity_by_bias @ bias, right.velocity, atol=1e-9)
    np.testing.assert_allclose(pushed.position - pushed.position_by_bias @ bias, right.position, atol=1e-9)


def test_nothing_is_integrated_across_a_gap_or_beyond_the_samples() -> None:
    samples = swinging(200)
    kept = np.r_[0:80, 120:200]
    gapped = motion_of(ImuSamples(samples.stamps_ns[kept], samples.angular_velocity[kept], samples.acceleration[kept]))
    at = samples.stamps_ns
    assert gapped.between(int(at[10]), int(at[70])) is not None
    assert gapped.between(int(at[10]), int(at[130])) is None
    assert gapped.between(int(at[150]), int(at[199]) + 100_000_000) is None
    assert SensorMotion().between(0, 1) is None


def test_samples_that_come_one_by_one_keep_the_latest_minutes_and_restart_where_time_goes_back() -> None:
    """Live: 7 minutes."""
    count = 84_000
    samples, grown = swinging(count), SensorMotion()
    assert grown.latest_ns == -1
    readings = np.concatenate([samples.angular_velocity, samples.acceleration], axis=1)
    for stamp_ns, reading in zip(samples.stamps_ns.tolist(), map(tuple, readings.tolist()), strict=True):
        grown.add_sample(stamp_ns, reading)
    start_ns, end_ns = int(samples.stamps_ns[-900]) + 1_234_567, int(samples.stamps_ns[-10])
    assert len(grown) < count and grown.latest_ns == samples.stamps_ns[-1]
    assert grown.between(int(samples.stamps_ns[0]), end_ns) is None
    one, other = grown.between(start_ns, end_ns), motion_of(samples).between(start_ns, end_ns)
    assert one and other
    np.testing.assert_allclose(one.rotation, other.rotation, atol=1e-9)
    np.testing.assert_allclose(one.position, other.position, atol=1e-6)
    np.testing.assert_allclose(one.rotation.T @ one.rotation, np.eye(3), atol=1e-12)
    # The recording is played again, while samples of both passes wait.
    again = swinging(400)
    grown.add(samples.between(end_ns, 2**62))
    grown.add(again)
    moved, fresh = grown.between(10**9, 2 * 10**9), motion_of(again).between(10**9, 2 * 10**9)
    assert moved and fresh and grown.latest_ns == again.stamps_ns[-1]
    np.testing.assert_allclose(moved.position, fresh.position, atol=1e-12)


def test_samples_that_are_not_finite_or_late_are_left_out() -> None:
    samples, wrong = swinging(100), SensorMotion()
    readings = np.concatenate([samples.angular_velocity, samples.acceleration], axis=1)
    for stamp_ns, reading in zip(samples.stamps_ns.tolist(), map(tuple, readings.tolist()), strict=True):
        wrong.add_sample(stamp_ns, reading)
        wrong.add_sample(stamp_ns + 1_000_000, (*reading[:5], np.nan))
        wrong.add_sample(stamp_ns - 500_000_000, (9.0,) * 6)
    ends = int(samples.stamps_ns[3]), int(samples.stamps_ns[90])
    one, other = wrong.between(*ends), motion_of(samples).between(*ends)
    assert one and other and len(wrong) == 100
    np.testing.assert_array_equal(one.position, other.position)


def test_the_kernel_integrates_as_numpy_does() -> None:
    samples, random = swinging(50), np.random.default_rng(3)
    stamps_ns = np.append(0, np.cumsum(random.integers(1_000_000, 20_000_000, 49)))
    samples = ImuSamples(stamps_ns, samples.angular_velocity, samples.acceleration)
    R, once, twice, readings = integrate(samples, stamps_ns)
    orientation = np.eye(3)
    first = np.zeros(12)
    second = np.zeros(12)
    for row, h in enumerate(1e-9 * np.diff(stamps_ns)):
        turned = orientation @ exp_so3(0.5 * h * (readings[row, :3] + readings[row + 1, :3]))
        before, after = (
            np.append(each.ravel(), each @ reading[3:])
            for each, reading in ((orientation, readings[row]), (turned, readings[row + 1]))
        )
        second = second + h * first + h**2 * (2.0 * before + after) / 6.0
        first, orientation = first + 0.5 * h * (before + after), turned
        np.testing.assert_allclose(R[row + 1], orientation, atol=1e-13)
        np.testing.assert_allclose(once[row + 1], first, atol=1e-12)
        np.testing.assert_allclose(twice[row + 1], second, atol=1e-12)
    np.testing.assert_array_equal(readings[:, 3:], samples.acceleration)
