"""Motion of a sensor between two stamps, by its own samples alone (Forster et al. 2017, "On-manifold preintegration").

Samples are integrated once, from the first on, in a frame that neither turns nor falls. The motion between any two
stamps is the difference of two such sums: it costs 0.06 ms at any length and at any stamps. gtsam's
``PreintegratedImuMeasurements`` starts anew for each interval and takes 5 us a sample, 0.04 ms for a frame and 2 ms for
two seconds of a bias filter; both agree to 1e-5 m/s. Biases and gravity enter afterwards, to first
order (Forster eq. 44).
"""

from array import array
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.geometry import Array
from bodycam_ros.inertial.imu_calibration import ImuCalibration
from bodycam_ros.inertial.imu_samples import ImuSamples
from bodycam_ros.inertial.preintegration_kernels import COLUMNS, add_samples, motion_between, sums_at

_KEEP_S = 120.0  # older sums are forgotten: a block of a recording that is solved as a whole is much shorter
_LEAST_ROWS = 256
_AHEAD_S = 0.012  # after the last sample, for which its reading holds: live, samples of the frame may still come


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


class MotionSums:
    """Integrals over the samples of a sensor, from the first on; samples may be added as they come.

    Samples that are not finite, or whose stamp does not increase, are left out. Where the stamps go back by more than a
    second, as of a bag that is played again, the sums restart.

    Args:
        calibration: of the sensor, if its samples are by its own clock and along its own axes; the sums are by the
            camera's clock, along the camera's axes.
    """

    def __init__(self, calibration: ImuCalibration | None = None) -> None:
        self._calibration = calibration or ImuCalibration()
        self._added_ns, self._readings = array("q"), array("d")  # of samples that are yet to be integrated
        self._latest: tuple[int, int, Preintegrated | None] = (-1, -1, None)
        # Stamps, count of gaps before, and sums, with room for more: live, some samples come with every frame.
        empty = np.empty(0, np.int64)
        self._rows: tuple[NDArray[Any], ...] = (empty, empty, np.empty((0, COLUMNS)))
        self._show(0)

    def add(self, samples: ImuSamples) -> None:
        """Add samples, later than those before; readings are linear between neighbours."""
        self._added_ns.frombytes(samples.stamps_ns.tobytes())
        self._readings.frombytes(np.concatenate([samples.angular_velocity, samples.acceleration], axis=1).tobytes())

    def add_sample(self, stamp_ns: int, reading: tuple[float, ...]) -> None:
        """Add one sample as it comes: its stamp [ns], angular velocity and acceleration in one tuple."""
        self._added_ns.append(stamp_ns)
        self._readings.extend(reading)

    def __len__(self) -> int:
        self._integrate()
        return len(self._stamps_ns)

    @property
    def latest_ns(self) -> int:
        """Stamp of the latest sample [ns]; -1 if there is none."""
        if self._added_ns:
            return self._added_ns[-1] - round(1e9 * self._calibration.time_offset)
        return int(self._stamps_ns[-1]) if len(self._stamps_ns) else -1

    def covers(self, stamps_ns: NDArray[np.int64]) -> NDArray[np.bool_]:
        """(T,) whether there are samples at stamps (T,) [ns]."""
        return self._numbers(stamps_ns) >= 0

    def between(self, start_ns: int, end_ns: int) -> Preintegrated | None:
        """Motion between two stamps [ns]; None unless samples cover all of it."""
        if self._latest[:2] != (start_ns, end_ns) or self._added_ns:
            # Several filters of one sensor need the same motion.
            self._latest = start_ns, end_ns, self._between(np.array([start_ns, end_ns]))
        return self._latest[2]

    def _between(self, ends_ns: NDArray[np.int64]) -> Preintegrated | None:
        first, second = self._numbers(ends_ns).tolist()
        if first < 0 or first != second:
            return None
        moved = motion_between(self._stamps_ns, self._sums, self._nodes(ends_ns), ends_ns)
        return Preintegrated(
            seconds=1e-9 * float(ends_ns[1] - ends_ns[0]),
            rotation=moved[:9].reshape(3, 3),
            velocity=moved[9:12],
            position=moved[12:15],
            first_rate=moved[15:18],
            second_rate=moved[18:21],
            change=moved[21:27],
            rotation_by_bias=moved[27:36].reshape(3, 3),
            velocity_by_bias=moved[36:45].reshape(3, 3),
            position_by_bias=moved[45:].reshape(3, 3),
        )

    def at(self, stamps_ns: NDArray[np.int64]) -> tuple[Array, Array, Array]:
        """Orientations (T, 3, 3), and integrals (T, 12) of R and R a, once and twice, at covered stamps (T,) [ns]."""
        self._integrate()
        sums = sums_at(self._stamps_ns, self._sums, self._nodes(stamps_ns), stamps_ns)
        return sums[:, :9].reshape(-1, 3, 3), sums[:, 9:21], sums[:, 21:33]

    def _nodes(self, stamps_ns: NDArray[np.int64]) -> NDArray[np.int64]:
        """(T,) the last sample at or before each stamp."""
        return np.searchsorted(self._stamps_ns, stamps_ns, side="right") - 1

    def _numbers(self, stamps_ns: NDArray[np.int64]) -> NDArray[np.int64]:
        """(T,) count of gaps before stamps (T,); -1 where there are no samples, as inside a gap."""
        self._integrate()
        if not len(self._stamps_ns):
            return np.full(len(stamps_ns), -1)
        nodes, last = self._nodes(stamps_ns), len(self._stamps_ns) - 1
        numbers = self._gaps[nodes]
        inside = (nodes >= 0) & (stamps_ns <= self._stamps_ns[last] + round(1e9 * _AHEAD_S))
        return np.where(inside & (self._gaps[np.minimum(nodes + 1, last)] == numbers), numbers, -1)

    def _integrate(self) -> None:
        if not self._added_ns:
            return
        stamps_ns, readings = np.array(self._added_ns), np.array(self._readings).reshape(-1, 6)
        self._added_ns, self._readings = array("q"), array("d")
        added = self._calibration.correct(ImuSamples(stamps_ns, readings[:, :3], readings[:, 3:]))
        readings = np.concatenate([added.angular_velocity, added.acceleration], axis=1)
        self._make_room(len(readings))
        stamps_ns, gaps, sums = self._rows
        self._show(add_samples(added.stamps_ns, readings, stamps_ns, gaps, sums, len(self._stamps_ns)))

    def _show(self, count: int) -> None:
        """Let the first rows be those in use."""
        self._stamps_ns, self._gaps, self._sums = (rows[:count] for rows in self._rows)

    def _make_room(self, count: int) -> None:
        """Make room for more rows; the oldest may be dropped."""
        used = len(self._stamps_ns)
        if used + count <= len(self._rows[0]):
            return
        first = 0
        if used and self._stamps_ns[-1] - self._stamps_ns[0] > 2e9 * _KEEP_S:
            first = int(np.searchsorted(self._stamps_ns, self._stamps_ns[-1] - 1e9 * _KEEP_S))
        larger = max(2 * (used - first), used - first + count, _LEAST_ROWS)
        free = larger - used + first
        self._rows = tuple(
            np.concatenate([rows[first:used], np.empty((free, *rows.shape[1:]), rows.dtype)]) for rows in self._rows
        )
        self._show(used - first)
