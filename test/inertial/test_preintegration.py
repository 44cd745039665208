"""Motion between two stamps: gtsam's preintegration of the same samples, and first-order corrections by biases."""

import gtsam
import numpy as np
import pytest

from bodycam_ros.geometry import Array, exp_so3
from bodycam_ros.inertial.imu_samples import ImuSamples
from bodycam_ros.inertial.preintegration import MotionSums

RATE_HZ, PERIOD_NS = 200, 5_000_000


def swinging(count: int, gyro_bias: Array | float = 0.0, accelerometer_bias: Array | float = 0.0) -> ImuSamples:
    """A limb that swings about changing axes."""
    t = np.arange(count) / RATE_HZ
    w = np.column_stack([3.0 * np.sin(4.0 * t), 2.0 * np.cos(3.0 * t), 1.5 * np.sin(7.0 * t + 1.0)])
    a = np.column_stack([5.0 * np.cos(5.0 * t), 9.8 + 3.0 * np.sin(6.0 * t), 4.0 * np.sin(2.0 * t)])
    return ImuSamples(10**9 + PERIOD_NS * np.arange(count), w + gyro_bias, a + accelerometer_bias)


def sums(samples: ImuSamples) -> MotionSums:
    made = MotionSums()
    made.add(samples)
    return made


def test_motion_is_gtsams() -> None:
    samples, (start, end) = swinging(400), (37, 301)
    moved = sums(samples).between(int(samples.stamps_ns[start]), int(samples.stamps_ns[end]))
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
    whole, parts = sums(samples), MotionSums()
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
    right = sums(swinging(200)).between(10**9, end_ns)
    turned = sums(swinging(200, gyro_bias=bias)).between(10**9, end_ns)
    pushed = sums(swinging(200, accelerometer_bias=bias)).between(10**9, end_ns)
    assert right and turned and pushed
    np.testing.assert_allclose(turned.rotation @ exp_so3(-turned.rotation_by_bias @ bias), right.rotation, atol=1e-7)
    np.testing.assert_allclose(pushed.velocity - pushed.velocity_by_bias @ bias, right.velocity, atol=1e-9)
    np.testing.assert_allclose(pushed.position - pushed.position_by_bias @ bias, right.position, atol=1e-9)


def test_nothing_is_integrated_across_a_gap_or_beyond_the_samples() -> None:
    samples = swinging(200)
    kept = np.r_[0:80, 120:200]
    gapped = sums(ImuSamples(samples.stamps_ns[kept], samples.angular_velocity[kept], samples.acceleration[kept]))
    at = samples.stamps_ns
    assert gapped.between(int(at[10]), int(at[70])) is not None
    assert gapped.between(int(at[10]), int(at[130])) is None
    assert gapped.between(int(at[150]), int(at[199]) + 100_000_000) is None
    assert MotionSums().between(0, 1) is None
