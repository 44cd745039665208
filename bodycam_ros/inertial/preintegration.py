"""Motion of a sensor between two stamps, by its own samples alone (Forster et al. 2017, "On-manifold preintegration").

Samples are integrated once, from the first on, in a frame that neither turns nor falls. The motion between any two
stamps is the difference of two such sums: it costs 0.06 ms at any length and at any stamps. gtsam's
``PreintegratedImuMeasurements`` starts anew for each interval and takes 5 us a sample, 0.04 ms for a frame and 2 ms for
two seconds of a bias filter; both agree to 1e-5 m/s. Biases and gravity enter afterwards, to first
order (Forster eq. 44).
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.geometry import Array
from bodycam_ros.inertial.imu_calibration import ImuCalibration
from bodycam_ros.inertial.imu_samples import ImuSamples
from bodycam_ros.inertial.preintegration_kernels import add_samples, motion_between

_KEEP_S = 120.0  # older sums are forgotten: a block of a recording that is solved as a whole is much shorter
_GAP_S = 0.03  # between neighbouring samples; a longer gap is not integrated across
_BACK_S = 1.0  # by which stamps go back where time restarts, and not because messages were exchanged
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


@dataclass(frozen=True, eq=False)
class _Sums:
    """Sums at T stamps: orientation (T, 3, 3), readings (T, 6), and integrals (T, 12) of R and R a, once and twice."""

    R: Array
    readings: Array
    once: Array
    twice: Array


class MotionSums:
    """Integrals over the samples of a sensor, from the first on; samples may be added as they come.

    Args:
        calibration: of the sensor, if its samples are by its own clock and along its own axes; the sums are by the
            camera's clock, along the camera's axes.
    """

    def __init__(self, calibration: ImuCalibration | None = None) -> None:
        self._calibration = calibration or ImuCalibration()
        self._pending: list[ImuSamples] = []
        self._stamps, self._readings = list[int](), list[float]()  # of samples that came one by one
        self._latest: tuple[int, int, Preintegrated | None] = (-1, -1, None)
        # With room for more: live, some samples come with every frame.
        self._rows: tuple[NDArray[Any], ...] = (
            *(np.zeros(0, np.int64), np.zeros(0, np.int64)),
            *(np.zeros((0, 3, 3)), np.zeros((0, 6)), np.zeros((0, 12)), np.zeros((0, 12))),
        )
        self._show(0)

    def add(self, samples: ImuSamples) -> None:
        """Add samples, later than those before; readings are linear between neighbours.

        Where the stamps go back by a second or more, as of a bag that is played again, the sums restart.
        """
        if len(samples):
            self._pending.append(samples)

    def add_sample(self, stamp_ns: int, reading: tuple[float, ...]) -> None:
        """Add one sample as it comes: its stamp [ns], angular velocity and acceleration in one tuple."""
        self._stamps.append(stamp_ns)
        self._readings.extend(reading)

    def __len__(self) -> int:
        self._integrate_pending()
        return len(self._stamps_ns)

    @property
    def latest_ns(self) -> int:
        """Stamp of the latest sample [ns]; -1 if there is none."""
        if self._stamps or self._pending:
            latest_ns = self._stamps[-1] if self._stamps else int(self._pending[-1].stamps_ns[-1])
            return latest_ns - round(1e9 * self._calibration.time_offset)
        return int(self._stamps_ns[-1]) if len(self._stamps_ns) else -1

    def covers(self, stamps_ns: NDArray[np.int64]) -> NDArray[np.bool_]:
        """(T,) whether there are samples at stamps (T,) [ns]."""
        self._integrate_pending()
        if not len(self._stamps_ns):
            return np.zeros(len(stamps_ns), bool)
        after = np.searchsorted(self._stamps_ns, stamps_ns, side="right")
        inside = (after > 0) & (stamps_ns <= self._stamps_ns[-1] + 1e9 * _AHEAD_S)
        next_gap = self._gaps[np.minimum(after, len(self._gaps) - 1)]
        covered: NDArray[np.bool_] = inside & (next_gap == self._gaps[np.maximum(after - 1, 0)])
        return covered

    def between(self, start_ns: int, end_ns: int) -> Preintegrated | None:
        """Motion between two stamps [ns]; None unless samples cover all of it."""
        if self._latest[:2] != (start_ns, end_ns) or self._pending or self._stamps:
            # Several filters of one sensor need the same motion.
            self._latest = start_ns, end_ns, self._between(start_ns, end_ns)
        return self._latest[2]

    def _between(self, start_ns: int, end_ns: int) -> Preintegrated | None:
        self._integrate_pending()
        stamps_ns, gaps, sums, last = self._stamps_ns, self._gaps, self._sums, len(self._stamps_ns) - 1
        if last < 0 or start_ns < stamps_ns[0] or end_ns > stamps_ns[last] + round(1e9 * _AHEAD_S):
            return None
        first, second = (np.searchsorted(stamps_ns, (start_ns, end_ns), side="right") - 1).tolist()
        # A stamp inside a gap has the number of the samples before it, and that after it is another.
        if not gaps[first] == gaps[min(first + 1, last)] == gaps[second] == gaps[min(second + 1, last)]:
            return None
        moved = motion_between(stamps_ns, sums.readings, sums.R, sums.once, sums.twice, first, second, start_ns, end_ns)
        return Preintegrated(
            seconds=1e-9 * (end_ns - start_ns),
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

    def at(self, stamps_ns: NDArray[np.int64]) -> _Sums:
        """Sums at stamps (T,) [ns] that samples cover."""
        nodes, sums, count = self._nodes(stamps_ns), self._sums, len(stamps_ns)
        following = np.minimum(nodes + 1, len(self._stamps_ns) - 1)
        h = 1e-9 * (stamps_ns - self._stamps_ns[nodes])
        period = np.maximum(1e-9 * (self._stamps_ns[following] - self._stamps_ns[nodes]), 1e-9)
        share = np.where(following > nodes, h / period, 0.0)[:, None]
        # From the sample before to the stamp, each in two rows.
        readings = np.stack([sums.readings[nodes], sums.readings[nodes] * (1.0 - share)], axis=1)
        readings[:, 1] += sums.readings[following] * share
        R, once, twice = np.empty((count, 2, 3, 3)), np.empty((count, 2, 12)), np.empty((count, 2, 12))
        R[:, 0], once[:, 0], twice[:, 0] = sums.R[nodes], sums.once[nodes], sums.twice[nodes]
        for row in range(count):
            add_samples(h[row : row + 1], readings[row], R[row], once[row], twice[row])
        return _Sums(R[:, 1], readings[:, 1], once[:, 1], twice[:, 1])

    def _nodes(self, stamps_ns: NDArray[np.int64]) -> NDArray[np.intp]:
        """(T,) the last sample at or before each stamp."""
        return np.maximum(np.searchsorted(self._stamps_ns, stamps_ns, side="right") - 1, 0)

    def _integrate_pending(self) -> None:
        if self._stamps:
            readings = np.array(self._readings).reshape(-1, 6)
            self.add(ImuSamples.from_readings(np.array(self._stamps, np.int64), readings))
            self._stamps, self._readings = [], []
        if not self._pending:
            return
        pending, self._pending = self._calibration.correct(ImuSamples.joined(self._pending)), []
        stamps_ns = pending.stamps_ns
        readings = np.concatenate([pending.angular_velocity, pending.acceleration], axis=1)
        back = np.flatnonzero(np.diff(stamps_ns, prepend=self._stamps_ns[-1:]) < -1e9 * _BACK_S)
        if len(back):
            stamps_ns, readings = stamps_ns[back[-1] :], readings[back[-1] :]
            self._show(0)
        if not len(self._stamps_ns):
            self._make_room(1)
            for rows, first in zip(self._rows, (stamps_ns[0], 0, np.eye(3), readings[0], 0.0, 0.0), strict=True):
                rows[0] = first
            self._show(1)
        later = stamps_ns > self._stamps_ns[-1]
        stamps_ns, readings = stamps_ns[later], readings[later]
        if not len(stamps_ns):
            return
        self._make_room(len(stamps_ns))
        count = len(self._stamps_ns)
        self._show(count + len(stamps_ns))
        self._stamps_ns[count:], self._sums.readings[count:] = stamps_ns, readings
        dt = 1e-9 * np.diff(self._stamps_ns[count - 1 :])
        self._gaps[count:] = self._gaps[count - 1] + np.cumsum(dt > _GAP_S)
        s, since = self._sums, slice(count - 1, None)
        add_samples(dt, s.readings[since], s.R[since], s.once[since], s.twice[since])

    def _show(self, count: int) -> None:
        """Let the first rows be those in use."""
        self._stamps_ns, self._gaps, *sums = (rows[:count] for rows in self._rows)
        self._sums = _Sums(*sums)

    def _make_room(self, count: int) -> None:
        """Make room for more rows; the oldest may be dropped."""
        used = len(self._stamps_ns)
        if used + count <= len(self._rows[0]):
            return
        first = 0
        if used and self._stamps_ns[-1] - self._stamps_ns[0] > 2e9 * _KEEP_S:
            first = int(np.searchsorted(self._stamps_ns, self._stamps_ns[-1] - 1e9 * _KEEP_S))
        larger = max(2 * (used - first), used - first + count, _LEAST_ROWS)
        grown = []
        for rows in self._rows:
            grown.append(np.empty((larger, *rows.shape[1:]), rows.dtype))
            grown[-1][: used - first] = rows[first:used]
        self._rows = tuple(grown)
        self._show(used - first)
