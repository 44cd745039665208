"""Motion of a sensor between two stamps, by its own samples alone (Forster et al. 2017, "On-manifold preintegration").

Readings are linear between samples, and each interval is integrated when it is asked for: 0.03 ms for a frame, 0.15 ms
for two seconds of 200 Hz. gtsam's ``PreintegratedImuMeasurements``, which holds a reading for a sample, takes 5 us a
sample. Biases and gravity enter afterwards, to first order (Forster eq. 44).
"""

import math
from array import array
from bisect import bisect_left, bisect_right
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.geometry import Array
from bodycam_ros.inertial.imu_calibration import ImuCalibration
from bodycam_ros.inertial.imu_samples import ImuSamples
from bodycam_ros.inertial.preintegration_kernels import sums_at

_KEEP_NS = 120_000_000_000  # samples that come one by one are forgotten when they are older
_AHEAD_NS = 12_000_000  # after the last sample, for which its reading holds: live, samples of the frame may still come
_GAP_NS = 30_000_000  # between neighbouring samples; a longer gap is not integrated across
_BACK_NS = 1_000_000_000  # by which stamps go back where time restarts, and not because messages were exchanged


@dataclass(frozen=True, eq=False)
class Preintegrated:
    """Motion between two stamps, in the sensor's frame at the first.

    With gravity g and the sensor's orientations R, velocities v and places p in the world at both stamps,

        R2 = R1 rotation,  v2 = v1 + g seconds + R1 velocity,  p2 = p1 + v1 seconds + g seconds^2 / 2 + R1 position

    Attributes:
        seconds: between the two.
        rotation: (3, 3) first_R_second.
        velocity: (3,) [m/s].
        position: (3,) [m].
        first_rate, second_rate: (3,) angular velocities at both stamps, in the sensor's frame [rad/s].
        change: (6,) of angular velocity and acceleration from the first to the second [rad/s], [m/s^2].
        rotation_by_bias: (3, 3) of the second frame about its own axes, by the gyroscope's bias, negated [s].
        velocity_by_bias, position_by_bias: (3, 3) by the accelerometer's bias, negated [s], [s^2].
    """

    seconds: float
    rotation: Array
    velocity: Array
    position: Array
    first_rate: Array
    second_rate: Array
    change: Array
    rotation_by_bias: Array
    velocity_by_bias: Array
    position_by_bias: Array


def integrate(samples: ImuSamples, stamps_ns: NDArray[np.int64]) -> tuple[Array, Array, Array, Array]:
    """Integrals over samples, from the first on, at T stamps [ns] that are not before it and do not decrease.

    Returns:
        Orientations R (T, 3, 3), the identity at first; integrals of R (nine columns) and R a (three), once and twice
        (T, 12), (T, 12); readings (T, 6), angular velocity and acceleration.
    """
    readings = np.concatenate([samples.angular_velocity, samples.acceleration], axis=1)
    sums = sums_at(samples.stamps_ns, readings, stamps_ns)
    return sums[:, :9].reshape(-1, 3, 3), sums[:, 9:21], sums[:, 21:33], sums[:, 33:]


class SensorMotion:
    """Motion of one sensor, whose samples may be added as they come.

    Samples that are not finite, or whose stamp does not increase, are left out. Where the stamps go back by more than a
    second, as of a bag that is played again, those before are forgotten.

    Args:
        calibration: of the sensor, if its samples are by its own clock and along its own axes; motion is by the
            camera's clock, along the camera's axes.
    """

    def __init__(self, calibration: ImuCalibration | None = None) -> None:
        self._calibration = calibration or ImuCalibration()
        self._offset_ns = round(1e9 * self._calibration.time_offset)
        self._stamps_ns, self._readings = array("q"), array("d")

    def add(self, samples: ImuSamples) -> None:
        """Add samples, later than those before."""
        readings = np.concatenate([samples.angular_velocity, samples.acceleration], axis=1)
        for stamp_ns, reading in zip(samples.stamps_ns.tolist(), map(tuple, readings.tolist()), strict=True):
            self._append(stamp_ns, reading)

    def add_sample(self, stamp_ns: int, reading: tuple[float, ...]) -> None:
        """Add one sample as it comes: its stamp [ns], angular velocity and acceleration in one tuple."""
        self._append(stamp_ns, reading)
        if self._stamps_ns and self._stamps_ns[-1] - self._stamps_ns[0] > 2 * _KEEP_NS:
            self._forget(bisect_left(self._stamps_ns, self._stamps_ns[-1] - _KEEP_NS))

    def __len__(self) -> int:
        return len(self._stamps_ns)

    @property
    def latest_ns(self) -> int:
        """Stamp of the latest sample [ns]; -1 if there is none."""
        return self._stamps_ns[-1] - self._offset_ns if self._stamps_ns else -1

    def between(self, start_ns: int, end_ns: int) -> Preintegrated | None:
        """Motion between two stamps [ns]; None unless samples cover all of it."""
        begin = bisect_right(self._stamps_ns, start_ns + self._offset_ns) - 1
        end = bisect_left(self._stamps_ns, end_ns + self._offset_ns) + 1
        if begin < 0 or end_ns > self.latest_ns + _AHEAD_NS:
            return None
        readings = np.array(self._readings[6 * begin : 6 * end]).reshape(-1, 6)
        samples = ImuSamples(np.array(self._stamps_ns[begin:end]), readings[:, :3], readings[:, 3:])
        if (np.diff(samples.stamps_ns) > _GAP_NS).any():
            return None
        samples, seconds = self._calibration.correct(samples), 1e-9 * (end_ns - start_ns)
        (R1, R2), once, twice, (first, second) = integrate(samples, np.array([start_ns, end_ns]))
        once, twice = once[1] - once[0], twice[1] - twice[0] - seconds * once[0]
        return Preintegrated(
            seconds=seconds,
            rotation=R1.T @ R2,
            velocity=R1.T @ once[9:],
            position=R1.T @ twice[9:],
            first_rate=first[:3],
            second_rate=second[:3],
            change=second - first,
            rotation_by_bias=R2.T @ once[:9].reshape(3, 3),
            velocity_by_bias=R1.T @ once[:9].reshape(3, 3),
            position_by_bias=R1.T @ twice[:9].reshape(3, 3),
        )

    def _append(self, stamp_ns: int, reading: tuple[float, ...]) -> None:
        if not all(map(math.isfinite, reading)):
            return
        if self._stamps_ns and stamp_ns <= self._stamps_ns[-1]:
            if stamp_ns >= self._stamps_ns[-1] - _BACK_NS:
                return
            self._forget(len(self._stamps_ns))
        self._stamps_ns.append(stamp_ns)
        self._readings.extend(reading)

    def _forget(self, count: int) -> None:
        """Forget so many of the oldest samples."""
        del self._stamps_ns[:count], self._readings[: 6 * count]
