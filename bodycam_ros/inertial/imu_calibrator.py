"""Calibration of a camera's inertial sensor against the camera's own registrations (Furgale, Rehder and Siegwart 2013).

The camera's rotations are compared with the integrated gyroscope over windows, each with a free orientation: that gives
the rotation between camera and sensor, the time offset, bias and scale. The camera's positions are compared with the
twice integrated accelerometer, with a free start and velocity in each window: its bias and scale, and the lever arm.
"""

import logging
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.errors import RangeOfMotionError
from bodycam_ros.geometry import Array, exp_so3, log_so3, nearest_rotation
from bodycam_ros.inertial.imu_calibration import ImuCalibration
from bodycam_ros.inertial.imu_samples import GRAVITY, ImuSamples

logger = logging.getLogger(__name__)

_WRONG_RAD = 3e-3  # root mean square of the residuals of rotation; larger, the sensor is left out
_WRONG_M_S2 = 2.0  # bias of an accelerometer; larger, it reads in g, or without gravity, or along other axes
_WINDOW_S, _SHORT_S = 2.0, 1.0  # of rotations, and of positions, whose errors grow faster
_ROTATION_RAD, _POSITION_M = 6e-4, 3e-3  # sigmas of a registration, of which a part is shared by neighbours
_KERNEL = 3.0  # sigmas from which on a registration counts less (Cauchy)
_STEPS = 12
_LEAST_IMAGES = 60
_OFFSETS_S = np.arange(-0.06, 0.0601, 0.002)  # first search of the time offset
_LEAST_TURN = 0.03  # [rad/s] root mean square of the angular velocity about each of two axes, to find the rotation
_SHARED = 2.0  # errors of neighbouring registrations are alike: sigmas of the result grow by so much


@dataclass(frozen=True, eq=False)
class CalibratedImu:
    """Outcome of a calibration.

    Attributes:
        calibration: of the sensor.
        rotation_rms: of the camera's rotations from the integrated gyroscope [rad].
    """

    calibration: ImuCalibration
    rotation_rms: float


class RegisteredSensors:
    """Collects the registrations of cameras with inertial sensors, and calibrates these.

    Args:
        imus: camera -> samples of its sensor.
    """

    def __init__(self, imus: Mapping[str, ImuSamples]) -> None:
        self._imus = imus
        self._stamps_ns: dict[str, list[int]] = {camera: [] for camera in imus}
        self._poses: dict[str, list[Array]] = {camera: [] for camera in imus}

    def add(self, camera: str, stamp_ns: int, world_T_camera: Array | None) -> None:
        """Add the pose (4, 4) of one image, in order of time; None if it was not registered."""
        if world_T_camera is not None and camera in self._imus:
            self._stamps_ns[camera].append(stamp_ns)
            self._poses[camera].append(world_T_camera)

    def calibrate(self) -> dict[str, ImuCalibration]:
        """Camera -> calibration, of those that could be calibrated; the others are warned about."""
        calibrations = {}
        for camera, samples in self._imus.items():
            stamps_ns, poses = np.array(self._stamps_ns[camera], np.int64), np.array(self._poses[camera])
            try:
                found = calibrate_imu(camera, stamps_ns, poses.reshape(-1, 4, 4), samples)
            except RangeOfMotionError as error:
                logger.warning("%s; the sensor is left out", error)
                continue
            if found.rotation_rms > _WRONG_RAD:
                logger.warning(
                    "camera %s: its inertial sensor differs from the images by %.2f deg, expected at most %.2f; it is "
                    "left out. Are its units rad/s and m/s^2, its axes right-handed, and its stamps even?",
                    camera,
                    np.degrees(found.rotation_rms),
                    np.degrees(_WRONG_RAD),
                )
                continue
            bias = float(np.linalg.norm(found.calibration.accelerometer_bias))
            if bias > _WRONG_M_S2:
                logger.warning(
                    "camera %s: the accelerometer of its inertial sensor differs from the images by %.1f m/s^2, "
                    "expected at most %.1f; the sensor is left out. Are its readings in m/s^2, with gravity, along the "
                    "axes of its gyroscope?",
                    camera,
                    bias,
                    _WRONG_M_S2,
                )
                continue
            calibrations[camera] = found.calibration
        return calibrations


def calibrate_imu(
    camera: str, stamps_ns: NDArray[np.int64], world_T_camera: Array, samples: ImuSamples
) -> CalibratedImu:
    """Calibrate the sensor of one camera.

    Args:
        camera: its name, for errors.
        stamps_ns: (T,) stamps of its registered images [ns].
        world_T_camera: (T, 4, 4) their poses; z of the world is up.
        samples: of the sensor, at least where images are.

    Raises:
        RangeOfMotionError: too few images with samples, or too little rotation.
    """
    first_ns, last_ns = (int(samples.stamps_ns[0]), int(samples.stamps_ns[-1])) if len(samples) else (0, 0)
    inside = (stamps_ns > first_ns + 1e8) & (stamps_ns < last_ns - 1e8)
    if inside.sum() < _LEAST_IMAGES:
        raise RangeOfMotionError(
            f"camera {camera}: its inertial sensor has samples at {int(inside.sum())} of {len(stamps_ns)} registered "
            f"images; a calibration needs {_LEAST_IMAGES}. Do the clocks of images and sensor agree?"
        )
    seconds, poses = 1e-9 * (stamps_ns[inside] - stamps_ns[0]), world_T_camera[inside]
    initial = _initial(camera, seconds, poses[:, :3, :3], samples, int(stamps_ns[0]))
    rotated, rms = _fit_rotations(initial, seconds, poses[:, :3, :3], samples, int(stamps_ns[0]))
    placed = _fit_positions(rotated, seconds, poses, samples, int(stamps_ns[0]))
    return CalibratedImu(placed, rms)


def _initial(camera: str, seconds: Array, R: Array, samples: ImuSamples, start_ns: int) -> ImuCalibration:
    """Rotation and time offset by angular velocities: the offset of the best alignment (Kabsch 1976)."""
    dt = np.diff(seconds)
    near = dt < 0.2
    w_camera = log_so3(np.swapaxes(R[:-1], 1, 2) @ R[1:])[near] / dt[near, None]
    times = np.asarray(1e-9 * (samples.stamps_ns - start_ns), np.float64)
    turned = np.concatenate([np.zeros((1, 3)), np.cumsum(_trapezoid(samples.angular_velocity, times), axis=0)])
    best: tuple[float, float, Array] | None = None
    for offset in _OFFSETS_S:
        ends = np.column_stack([np.interp(seconds + offset, times, column) for column in turned.T])
        w_imu = (np.diff(ends, axis=0) / dt[:, None])[near]
        centred = w_imu - w_imu.mean(axis=0)
        C = nearest_rotation((w_camera - w_camera.mean(axis=0)).T @ centred)
        cost = float(np.median(np.linalg.norm(w_camera - w_camera.mean(axis=0) - centred @ C.T, axis=1)))
        if best is None or cost < best[0]:
            best = cost, float(offset), C
    assert best is not None  # there are offsets
    spread = np.sqrt(np.linalg.eigvalsh(np.cov(w_camera.T))[::-1])
    if spread[1] < _LEAST_TURN:
        raise RangeOfMotionError(
            f"camera {camera}: it turned about one axis alone ({spread[1]:.2f} rad/s about others, needed "
            f"{_LEAST_TURN}), so the rotation of its inertial sensor is not determined; move its limb more freely"
        )
    return ImuCalibration(camera_R_imu=best[2], time_offset=best[1])


def _trapezoid(values: Array, times: Array) -> Array:
    """Integrals (N - 1, ...) of samples (N, ...) between neighbours."""
    dt = np.diff(times).reshape(-1, *([1] * (values.ndim - 1)))
    return np.asarray(0.5 * dt * (values[1:] + values[:-1]))


def _cumulative(values: Array, times: Array) -> Array:
    """Integrals (N, ...) from the first sample on."""
    return np.concatenate([np.zeros((1, *values.shape[1:])), np.cumsum(_trapezoid(values, times), axis=0)])


def _interpolated(at: Array, times: Array, values: Array) -> Array:
    """Values (T, ...) at other times, linear between samples."""
    row = np.clip(np.searchsorted(times, at, side="right") - 1, 0, len(times) - 2)
    share = ((at - times[row]) / (times[row + 1] - times[row])).reshape(-1, *([1] * (values.ndim - 1)))
    return np.asarray(values[row] * (1.0 - share) + values[row + 1] * share)


@dataclass(frozen=True, eq=False)
class _Integrated:
    """The corrected samples in the sensor's frame, and their orientation (N, 3, 3) in a fixed frame."""

    times: Array
    w: Array
    a: Array
    R: Array

    @staticmethod
    def by(calibration: ImuCalibration, samples: ImuSamples, start_ns: int) -> "_Integrated":
        times = np.asarray(1e-9 * (samples.stamps_ns - start_ns), np.float64)
        w = (samples.angular_velocity - calibration.gyro_bias) / calibration.gyro_scale
        a = (samples.acceleration - calibration.accelerometer_bias) / calibration.accelerometer_scale
        R = np.empty((len(times), 3, 3))
        R[0] = np.eye(3)
        for row, turn in enumerate(exp_so3(_trapezoid(w, times))):
            R[row + 1] = R[row] @ turn
        return _Integrated(times, w, a, nearest_rotation(R))

    def orientation(self, at: Array) -> Array:
        """(T, 3, 3) at times (T,)."""
        row = np.clip(np.searchsorted(self.times, at, side="right") - 1, 0, len(self.times) - 1)
        turns = exp_so3(np.asarray((at - self.times[row])[:, None] * self.w[row], np.float64))
        return np.asarray(self.R[row] @ turns)


def _fit_rotations(
    calibration: ImuCalibration, seconds: Array, R: Array, samples: ImuSamples, start_ns: int
) -> tuple[ImuCalibration, float]:
    """Rotation, time offset, bias and scale of the gyroscope, by Gauss-Newton; and the residuals' root mean square."""
    windows = (seconds // _WINDOW_S).astype(int)
    windows = np.unique(windows, return_inverse=True)[1]
    window_count = int(windows.max()) + 1
    count = 10 + 3 * window_count
    world_R_sums = np.zeros((0, 3, 3))
    for step in range(_STEPS):
        integrated = _Integrated.by(calibration, samples, start_ns)
        at, C = seconds + calibration.time_offset, calibration.camera_R_imu
        sums_R_camera = integrated.orientation(at) @ C.T
        if step < 3:
            # Sums start anew with each bias: each window's orientation is that of its images.
            apart = R @ np.swapaxes(sums_R_camera, 1, 2)
            world_R_sums = nearest_rotation(np.array([apart[windows == w].mean(axis=0) for w in range(window_count)]))
        W = world_R_sums[windows]
        r = log_so3(np.swapaxes(W @ sums_R_camera, 1, 2) @ R) / _ROTATION_RAD
        camera_R_sums = np.swapaxes(sums_R_camera, 1, 2)
        by_bias = _cumulative(integrated.R / calibration.gyro_scale, integrated.times)
        by_scale = _cumulative(integrated.R * (integrated.w / calibration.gyro_scale)[:, None, :], integrated.times)
        J = np.zeros((len(seconds), 3, count))
        J[..., :3] = -C
        J[..., 3] = _interpolated(at, integrated.times, integrated.w) @ C.T
        for columns, sums in ((slice(4, 7), by_bias), (slice(7, 10), by_scale)):
            since = _interpolated(at, integrated.times, sums)
            starts = np.array([since[windows == w][0] for w in range(window_count)])
            J[..., columns] = -camera_R_sums @ (since - starts[windows])
        for row, w in enumerate(windows):
            J[row, :, 10 + 3 * w : 13 + 3 * w] = camera_R_sums[row]
        J /= _ROTATION_RAD
        weights = 1.0 / (1.0 + (r**2).sum(axis=1) / (3.0 * _KERNEL**2))
        weighted = J.transpose(2, 0, 1) * weights[:, None]
        information = np.tensordot(weighted, J, axes=([1, 2], [0, 1]))
        # Sensors are known to be about right: the scale of what hardly turns stays one, and so on.
        prior = np.zeros(count)
        prior[4:7], prior[7:10] = 0.1**-2, 0.01**-2
        pull = np.zeros(count)
        pull[4:7], pull[7:10] = -calibration.gyro_bias, 1.0 - calibration.gyro_scale
        information[np.diag_indices(count)] += prior + 1e-6
        x = np.linalg.solve(information, np.tensordot(weighted, r, axes=([1, 2], [0, 1])) + prior * pull)
        calibration = replace(
            calibration,
            camera_R_imu=nearest_rotation(C @ exp_so3(np.asarray(x[:3], np.float64))),
            time_offset=calibration.time_offset + float(x[3]),
            gyro_bias=calibration.gyro_bias + x[4:7],
            gyro_scale=calibration.gyro_scale + x[7:10],
        )
        world_R_sums = world_R_sums @ exp_so3(np.asarray(x[10:].reshape(-1, 3), np.float64))
        if np.abs(x[:10]).max() < 1e-7:
            break
    sigmas = _SHARED * np.sqrt(np.diag(np.linalg.inv(information)))
    rms = _ROTATION_RAD * float(np.sqrt(np.average((r**2).mean(axis=1), weights=weights)))
    calibration = replace(
        calibration,
        rotation_sigma=float(sigmas[:3].max()),
        time_offset_sigma=float(sigmas[3]),
        gyro_bias_sigma=float(sigmas[4:7].max()),
        gyro_scale_sigma=float(sigmas[7:10].max()),
    )
    return calibration, rms


def _fit_positions(
    calibration: ImuCalibration, seconds: Array, poses: Array, samples: ImuSamples, start_ns: int
) -> ImuCalibration:
    """Lever arm, bias and scale of the accelerometer, by linear least squares."""
    windows = np.unique((seconds // _SHORT_S).astype(int), return_inverse=True)[1]
    integrated = _Integrated.by(calibration, samples, start_ns)
    at, times = seconds + calibration.time_offset, integrated.times
    # One orientation of the sums in the world for each window, by all of its images.
    per_image = poses[:, :3, :3] @ calibration.camera_R_imu @ np.swapaxes(integrated.orientation(at), 1, 2)
    force, turned = integrated.R @ integrated.a[..., None], integrated.R
    scaled = integrated.R * integrated.a[:, None, :]
    twice = _twice(np.concatenate([force, turned, scaled], axis=2), times)
    count = 9 + 6 * (int(windows.max()) + 1)
    J, r = np.zeros((len(seconds), 3, count)), np.zeros((len(seconds), 3))
    for w in range(int(windows.max()) + 1):
        rows = np.flatnonzero(windows == w)
        W, since = nearest_rotation(per_image[rows].mean(axis=0)), at[rows] - at[rows[0]]
        once, both = (_interpolated(at[rows], times, each) for each in twice)
        moved = W @ (both - both[0] - since[:, None, None] * once[0])
        r[rows] = poses[rows, :3, 3] - moved[..., 0]
        r[rows, 2] += 0.5 * GRAVITY * since**2
        # residual = start + velocity t - by_bias b - by_scale s - R lever
        J[rows, :, :3] = -poses[rows, :3, :3]
        J[rows, :, 3:6], J[rows, :, 6:9] = -moved[..., 1:4], -moved[..., 4:7]
        column = 9 + 6 * w
        J[rows, :, column : column + 3] = np.eye(3)
        J[rows, :, column + 3 : column + 6] = since[:, None, None] * np.eye(3)
    J, r = J / _POSITION_M, r / _POSITION_M
    prior = np.zeros(count)
    prior[:3], prior[3:6], prior[6:9] = 0.015**-2, 0.3**-2, 0.006**-2
    weights = np.ones(len(seconds))
    for _ in range(5):
        weighted = J.transpose(2, 0, 1) * weights[:, None]
        information = np.tensordot(weighted, J, axes=([1, 2], [0, 1])) + np.diag(prior + 1e-9)
        x = np.linalg.solve(information, np.tensordot(weighted, r, axes=([1, 2], [0, 1])))
        left = r - J @ x
        weights = 1.0 / (1.0 + (left**2).sum(axis=1) / (3.0 * _KERNEL**2))
    sigmas = _SHARED * np.sqrt(np.diag(np.linalg.inv(information)))
    return replace(
        calibration,
        camera_p_imu=np.asarray(x[:3], np.float64),
        accelerometer_bias=calibration.accelerometer_bias + x[3:6],
        accelerometer_scale=calibration.accelerometer_scale + x[6:9],
        position_sigma=float(sigmas[:3].max()),
        accelerometer_bias_sigma=float(sigmas[3:6].max()),
    )


def _twice(rates: Array, times: Array) -> tuple[Array, Array]:
    """Integrals (N, ...) of samples (N, ...), once and twice, linear between samples."""
    once = _cumulative(rates, times)
    dt = np.diff(times).reshape(-1, *([1] * (rates.ndim - 1)))
    steps = dt * once[:-1] + dt**2 * (2.0 * rates[:-1] + rates[1:]) / 6.0
    return once, np.concatenate([np.zeros((1, *rates.shape[1:])), np.cumsum(steps, axis=0)])
