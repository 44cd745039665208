"""Follows bias and delay of a sensor by its camera's registrations: an attitude filter (Lefferts et al. 1982)."""

from collections import deque

import numpy as np

from bodycam_ros.geometry import Array, exp_so3, log_so3
from bodycam_ros.inertial.imu_calibration import ImuCalibration
from bodycam_ros.inertial.imu_samples import GRAVITY
from bodycam_ros.inertial.preintegration import Preintegrated, SensorMotion

WANDER = 3e-4  # [rad/s/sqrt(s)] of a consumer gyroscope's bias
TURN_ON = 1.5e-3  # [rad/s] by which a bias may differ from that of the calibration
_DELAY_TURN_ON = 3e-3  # [s] by which the delay to the images may differ: another with each power cycle of some cameras
_SIGNIFICANT = 2.0  # sigmas of a delay; else that of the calibration is known better
_IMAGE_RAD = 1.5e-3  # sigma of a registered rotation: errors of neighbouring images are alike
_SCALE = 0.005  # of a gyroscope's scale and axes, as a share of the turn
_IDENTITY = np.eye(3)
_IMAGE = _IMAGE_RAD**2 * _IDENTITY
_LEAST_S, _LONGEST_S = 0.4, 2.0  # between two images of an update
_GATE = 25.0  # squared sigmas of 3 degrees of freedom
_RECENT, _CONTRADICTIONS = 12, 3  # updates, of which so many may not contradict the images


class SensorFilter:
    """Counts whether one sensor agrees with the images of its camera.

    Attributes:
        agreeing, contradicting: count of updates that agreed with the images and that did not.
        is_confirmed: whether the images have confirmed the sensor.
        is_wrong: whether it contradicts the images too often: wrong axes or units, frozen, saturated, late.
        was_wrong: whether it did so at any time.
    """

    def __init__(self) -> None:
        self.agreeing = self.contradicting = 0
        self.is_confirmed = self.is_wrong = self.was_wrong = False
        self._recent: deque[bool] = deque(maxlen=_RECENT)

    def _count(self, agrees: bool) -> None:
        self.agreeing, self.contradicting = self.agreeing + agrees, self.contradicting + (not agrees)
        self._recent.append(agrees)
        fails = self._recent.count(False) >= _CONTRADICTIONS
        self.was_wrong |= fails
        self.is_wrong = fails or self.contradicting > self.agreeing
        self.is_confirmed = self.agreeing > self.contradicting


class BiasFilter(SensorFilter):
    """Bias and delay of one gyroscope, beside those of its calibration, in the axes of its motion.

    Args:
        calibration: of the sensor, if its samples are by its own clock and along its own axes.

    Attributes:
        motion: of the sensor, by its samples.
        bias: (3,) [rad/s].
        delay: of its samples to the images [s]; 0 unless it is significant.
    """

    def __init__(self, calibration: ImuCalibration) -> None:
        super().__init__()
        self.motion = SensorMotion(calibration)
        self.bias = np.zeros(3)
        self.delay = 0.0
        self._delay = 0.0
        # The covariance is that of rotation, bias and delay.
        bias_variance = calibration.gyro_bias_sigma**2 + TURN_ON**2
        self._P = np.diag(np.repeat([_IMAGE_RAD**2, bias_variance, _DELAY_TURN_ON**2], [3, 3, 1]))
        self._R: Array | None = None
        self._stamp_ns = 0

    @property
    def sigma(self) -> float:
        """Sigma of the bias [rad/s]."""
        return float(np.sqrt(np.trace(self._P[3:6, 3:6]) / 3.0))

    def moved(self, start_ns: int, end_ns: int) -> Preintegrated | None:
        """Motion between two stamps of the camera [ns]; None unless samples cover all of it."""
        return self._moved(start_ns, end_ns, self.delay)

    def observe(self, stamp_ns: int, R: Array) -> None:
        """Update by a registered rotation (3, 3) in the world, later than the one before."""
        seconds = 1e-9 * (stamp_ns - self._stamp_ns)
        if self._R is not None and 0.0 <= seconds < _LEAST_S:
            return
        # Where time goes back, as of a bag that is played again, the bias is kept.
        is_near = self._R is not None and 0.0 < seconds < _LONGEST_S
        moved = self._moved(self._stamp_ns, stamp_ns, self._delay) if is_near else None
        if moved is None:
            self._P[3:6, 3:6] += min(abs(seconds), 60.0) * WANDER**2 * _IDENTITY if self._R is not None else 0.0
            self._restart(R)
        else:
            self._update(moved, R)
        self._stamp_ns = stamp_ns

    def _moved(self, start_ns: int, end_ns: int, delay: float) -> Preintegrated | None:
        return self.motion.between(start_ns + round(1e9 * delay), end_ns + round(1e9 * delay))

    def _restart(self, R: Array) -> None:
        """Begin at a rotation; bias and delay are kept."""
        self._R, self._P[:3, 3:], self._P[3:, :3], self._P[:3, :3] = R, 0.0, 0.0, _IMAGE

    def _update(self, moved: Preintegrated, R: Array) -> None:
        assert self._R is not None  # by the caller
        F = np.eye(7)
        F[:3, :3], F[:3, 3:6] = moved.rotation.T, -moved.rotation_by_bias
        F[:3, 6] = moved.second_rate - moved.rotation.T @ moved.first_rate
        P = F @ self._P @ F.T
        P[3:6, 3:6] += moved.seconds * WANDER**2 * _IDENTITY
        predicted = self._R @ turned(moved, self.bias)
        r, turn = log_so3(np.stack([predicted.T @ R, moved.rotation]))
        S = P[:3, :3] + _IMAGE + _SCALE**2 * (turn @ turn) * _IDENTITY
        information = np.linalg.inv(S)
        self._count(agrees := bool(r @ information @ r <= _GATE))
        if not agrees:
            self._restart(R)
            return
        gain = P[:, :3] @ information
        step = gain @ r
        self._R, self._P = predicted @ exp_so3(step[:3]), P - gain @ P[:3]
        self.bias, self._delay = self.bias + step[3:6], self._delay + float(step[6])
        self.delay = self._delay if abs(self._delay) > _SIGNIFICANT * np.sqrt(self._P[6, 6]) else 0.0


def turned(moved: Preintegrated, bias: Array) -> Array:
    """Rotation (3, 3) of a motion, with a bias (3,) taken out [rad/s]."""
    R: Array = moved.rotation @ exp_so3(-moved.rotation_by_bias @ bias)
    return R


_ACCELERATION_WANDER = 5e-4  # [m/s^2/sqrt(s)] of a consumer accelerometer's bias
_ACCELERATION_TURN_ON = 0.02  # [m/s^2] by which it may differ from that of the calibration
_TILT_RAD = 5e-4  # of a registered rotation: gravity leaks into the other axes
_IMAGE_M = 3e-3  # sigma of a registered position
_KNOWN_M = 0.1  # sigma of a predicted position, beyond which its velocity is not known yet
_ACCELERATION_GATE = 100.0  # squared sigmas: readings in g, or along other axes, are off by a hundred sigmas


class AccelerometerFilter(SensorFilter):
    """Bias of one accelerometer, beside that of its calibration, by registered places: a filter of place and velocity.

    Args:
        sigma: of the bias at first [m/s^2].
        density: of the acceleration's noise [m/s^2/sqrt(Hz)].

    The bias is in the axes of its motion.
    """

    def __init__(self, sigma: float, density: float) -> None:
        super().__init__()
        self._density, self._first = density, np.hypot(sigma, _ACCELERATION_TURN_ON)
        self._x, self._P = np.zeros(9), np.diag(np.repeat([1.0, 4.0, self._first**2], 3))
        self._R = np.eye(3)
        self._stamp_ns = 0

    @property
    def bias(self) -> Array:
        """(3,) [m/s^2]."""
        return self._x[6:]

    @property
    def sigma(self) -> float:
        """Sigma of the bias [m/s^2]."""
        return float(np.sqrt(np.trace(self._P[6:, 6:]) / 3.0))

    def observe(self, stamp_ns: int, R: Array, place: Array, motion: SensorMotion) -> None:
        """Update by the registered rotation (3, 3) and place (3,) of the sensor in the world."""
        dt = 1e-9 * (stamp_ns - self._stamp_ns)
        if self._stamp_ns and 0.0 <= dt < _LEAST_S:
            return
        moved = motion.between(self._stamp_ns, stamp_ns) if self._stamp_ns and 0.0 < dt < _LONGEST_S else None
        if moved is None:
            self._P[6:, 6:] += min(abs(dt), 60.0) * _ACCELERATION_WANDER**2 * _IDENTITY if self._stamp_ns else 0.0
            self._restart()
        else:
            gravity = np.array([0.0, 0.0, -GRAVITY])
            F = np.eye(9)
            F[:3, 3:6] = dt * _IDENTITY
            F[:3, 6:], F[3:6, 6:] = -self._R @ moved.position_by_bias, -self._R @ moved.velocity_by_bias
            self._x = F @ self._x
            self._x[:3] += 0.5 * gravity * dt**2 + self._R @ moved.position
            self._x[3:6] += gravity * dt + self._R @ moved.velocity
            q = self._density**2 + (_TILT_RAD * GRAVITY) ** 2 * dt
            Q = np.kron(q * np.array([[dt**3 / 3.0, dt**2 / 2.0], [dt**2 / 2.0, dt]]), np.eye(3))
            self._P = F @ self._P @ F.T
            self._P[:6, :6] += Q
            self._P[6:, 6:] += dt * _ACCELERATION_WANDER**2 * _IDENTITY
        S = self._P[:3, :3] + _IMAGE_M**2 * _IDENTITY
        if S.trace() < 3.0 * _KNOWN_M**2:
            off = place - self._x[:3]
            self._count(agrees := bool(off @ np.linalg.solve(S, off) <= _ACCELERATION_GATE))
            if not agrees:
                self._restart()
                S = self._P[:3, :3] + _IMAGE_M**2 * _IDENTITY
        gain = np.linalg.solve(S, self._P[:3]).T
        self._x = self._x + gain @ (place - self._x[:3])
        self._P = self._P - gain @ self._P[:3]
        self._R, self._stamp_ns = R, stamp_ns

    def _restart(self) -> None:
        """Forget place and velocity; the bias is kept."""
        self._x[:6] = 0.0
        self._P[:6], self._P[:, :6] = 0.0, 0.0
        self._P[:6, :6] = np.diag(np.repeat([100.0, 16.0], 3))
