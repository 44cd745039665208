"""Calibration of a camera's inertial sensor against the camera's own registrations (Furgale, Rehder and Siegwart 2013).

The camera's rotations are compared with the integrated gyroscope over windows, each with a free orientation: that gives
the rotation between camera and sensor, the time offset, bias and scale. The camera's positions are compared with the
twice integrated accelerometer, with a free start and velocity in each window: its bias and scale, and the lever arm.
"""

import logging
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.errors import RangeOfMotionError
from bodycam_ros.geometry import Array, exp_so3, log_so3, nearest_rotation
from bodycam_ros.inertial.imu_calibration import ImuCalibration
from bodycam_ros.inertial.imu_samples import GRAVITY, ImuSamples
from bodycam_ros.inertial.preintegration import integrate
from bodycam_ros.robust_least_squares import by_differences, robust_least_squares

logger = logging.getLogger(__name__)

_WRONG_RAD = 5e-3  # root mean square of the residuals of rotation; larger, the sensor is wrong
_WRONG_M_S2 = 2.0  # bias of an accelerometer; larger, it reads in g, or without gravity, or along other axes
_WINDOW_S, _SHORT_S = 2.0, 1.0  # of rotations, and of positions, whose errors grow faster
_ROTATION_RAD, _POSITION_M = 6e-4, 3e-3  # sigmas of a registration, of which a part is shared by neighbours
_KERNEL = 3.0  # sigmas from which on a registration counts less (Cauchy)
_STEPS, _CONVERGED = 12, 1e-7
_SMALL = 1e-5  # [rad], [s], [m] of a difference quotient: stamps are rounded to 1e-9 s
_GYROSCOPE_PRIOR = np.repeat([1e3, 0.1, 0.01], [4, 3, 3])  # of rotation and time offset, bias, scale
_ACCELEROMETER_PRIOR = np.repeat([0.015, 0.3, 0.006], 3)  # of place, bias, scale
_LEAST_IMAGES = 60
_OFFSETS_S = np.arange(-0.06, 0.0601, 0.002)  # first search of the time offset
_LEAST_TURN = 0.03  # [rad/s] root mean square of the angular velocity about each of two axes, to find the rotation
_SHARED = 2.0  # errors of neighbouring registrations are alike: sigmas of the result grow by so much


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
                calibration = calibrate_imu(camera, stamps_ns, poses.reshape(-1, 4, 4), samples)
            except RangeOfMotionError as error:
                logger.warning("inertial sensor not used: %s", error)
                continue
            bias = float(np.linalg.norm(calibration.accelerometer_bias))
            if bias > _WRONG_M_S2:
                logger.warning(
                    "camera %s: the accelerometer of its inertial sensor differs from the images by %.1f m/s^2, "
                    "expected at most %.1f; the sensor is not used. Its readings must be in m/s^2, with gravity, along "
                    "the axes of its gyroscope",
                    camera,
                    bias,
                    _WRONG_M_S2,
                )
                continue
            calibrations[camera] = calibration
        return calibrations


def calibrate_imu(
    camera: str, stamps_ns: NDArray[np.int64], world_T_camera: Array, samples: ImuSamples
) -> ImuCalibration:
    """Calibrate the sensor of one camera.

    Args:
        camera: its name, for errors.
        stamps_ns: (T,) stamps of its registered images [ns].
        world_T_camera: (T, 4, 4) their poses; z of the world is up.
        samples: of the sensor, at least where images are.

    Raises:
        RangeOfMotionError: too few images with samples, too little rotation, or the two contradict each other.
    """
    first_ns, last_ns = (int(samples.stamps_ns[0]), int(samples.stamps_ns[-1])) if len(samples) else (0, 0)
    inside = (stamps_ns > first_ns + 1e8) & (stamps_ns < last_ns - 1e8)
    if inside.sum() < _LEAST_IMAGES:
        raise RangeOfMotionError(
            f"camera {camera}: its inertial sensor has samples at {int(inside.sum())} of {len(stamps_ns)} registered "
            f"images; a calibration needs {_LEAST_IMAGES}. Check that the clocks of images and sensor agree"
        )
    images = _Images(stamps_ns[inside], world_T_camera[inside], samples)
    initial = _initial(camera, images)
    rotated = _fit(lambda x: images.rotation_errors(_turned(initial, x)) / _ROTATION_RAD, _GYROSCOPE_PRIOR)
    if (off_rad := _ROTATION_RAD * rotated.rms) > _WRONG_RAD:
        raise RangeOfMotionError(
            f"camera {camera}: its inertial sensor differs from the images by {np.degrees(off_rad):.2f} deg, expected "
            f"at most {np.degrees(_WRONG_RAD):.2f}. Its units must be rad/s and m/s^2, its axes right-handed, and its "
            "stamps even"
        )
    turned = replace(
        _turned(initial, rotated.values),
        rotation_sigma=float(rotated.sigmas[:3].max()),
        time_offset_sigma=float(rotated.sigmas[3]),
        gyro_bias_sigma=float(rotated.sigmas[4:7].max()),
        gyro_scale_sigma=float(rotated.sigmas[7:].max()),
    )
    placed = _fit(lambda x: images.position_errors(_placed(turned, x)) / _POSITION_M, _ACCELEROMETER_PRIOR)
    return replace(
        _placed(turned, placed.values),
        position_sigma=float(placed.sigmas[:3].max()),
        accelerometer_bias_sigma=float(placed.sigmas[3:6].max()),
    )


def _turned(calibration: ImuCalibration, x: Array) -> ImuCalibration:
    """A calibration whose rotation, time offset, bias and scale of the gyroscope differ by x (10)."""
    return replace(
        calibration,
        camera_R_imu=calibration.camera_R_imu @ exp_so3(x[:3]),
        time_offset=calibration.time_offset + float(x[3]),
        gyro_bias=calibration.gyro_bias + x[4:7],
        gyro_scale=calibration.gyro_scale + x[7:],
    )


def _placed(calibration: ImuCalibration, x: Array) -> ImuCalibration:
    """A calibration whose place, and bias and scale of the accelerometer, differ by x (9)."""
    return replace(
        calibration,
        camera_p_imu=calibration.camera_p_imu + x[:3],
        accelerometer_bias=calibration.accelerometer_bias + x[3:6],
        accelerometer_scale=calibration.accelerometer_scale + x[6:],
    )


@dataclass(frozen=True, eq=False)
class _Images:
    """Registered images (T,) of a camera, and the samples of its sensor."""

    stamps_ns: NDArray[np.int64]
    world_T_camera: Array
    samples: ImuSamples

    @property
    def seconds(self) -> Array:
        """(T,) since the first [s]."""
        return np.asarray(1e-9 * (self.stamps_ns - self.stamps_ns[0]), np.float64)

    def rotation_errors(self, calibration: ImuCalibration) -> Array:
        """(T, 3) rotations from the integrated gyroscope, in windows that begin anywhere [rad]."""
        world_R_sums, sums_R_camera, _ = self._integrated(calibration, _WINDOW_S)
        return log_so3(np.swapaxes(world_R_sums @ sums_R_camera, 1, 2) @ self.world_T_camera[:, :3, :3])

    def position_errors(self, calibration: ImuCalibration) -> Array:
        """(T, 3) places from the twice integrated accelerometer, in windows of free start and velocity [m]."""
        world_R_sums, _, twice = self._integrated(calibration, _SHORT_S)
        errors = self.world_T_camera[:, :3, 3] + self.world_T_camera[:, :3, :3] @ calibration.camera_p_imu
        errors = errors - (world_R_sums @ twice[:, 9:, None])[..., 0]
        seconds = self.seconds
        errors[:, 2] += 0.5 * GRAVITY * seconds**2
        for rows in self._windows(_SHORT_S):
            basis = np.linalg.qr(np.column_stack([np.ones(len(rows)), seconds[rows]]))[0]
            errors[rows] -= basis @ (basis.T @ errors[rows])
        return errors

    def _integrated(self, calibration: ImuCalibration, window_s: float) -> tuple[Array, Array, Array]:
        """At each image world_R_sums (T, 3, 3) of its window, the sums' orientation and twice integrals (T, 12)."""
        sums_R_camera, _, twice, _ = integrate(calibration.correct(self.samples), self.stamps_ns)
        world_R_sums = self.world_T_camera[:, :3, :3] @ np.swapaxes(sums_R_camera, 1, 2)
        for rows in self._windows(window_s):
            world_R_sums[rows] = nearest_rotation(world_R_sums[rows].mean(axis=0))
        return world_R_sums, sums_R_camera, twice

    def _windows(self, window_s: float) -> list[NDArray[np.intp]]:
        numbers = (self.seconds // window_s).astype(int)
        return [np.flatnonzero(numbers == number) for number in np.unique(numbers)]


@dataclass(frozen=True, eq=False)
class _Fit:
    """Values (K) and their sigmas, and the residuals' root mean square."""

    values: Array
    sigmas: Array
    rms: float


def _fit(residuals: Callable[[Array], Array], prior: Array) -> _Fit:
    """Values (K) around zero, of sigmas ``prior``, by residuals (T, 3) in sigmas."""
    # By the mean of the squares over the three axes.
    fit = robust_least_squares(
        by_differences(residuals, _SMALL), np.zeros(len(prior)), prior, np.sqrt(3.0) * _KERNEL, _STEPS, _CONVERGED
    )
    sigmas = _SHARED * np.sqrt(np.diag(fit.covariance))
    return _Fit(fit.values, sigmas, float(np.sqrt(np.average((fit.residuals**2).mean(axis=1), weights=fit.weights))))


def _initial(camera: str, images: _Images) -> ImuCalibration:
    """Rotation and time offset by angular velocities: the offset of the best alignment (Kabsch 1976)."""
    seconds, R = images.seconds, images.world_T_camera[:, :3, :3]
    dt = np.diff(seconds)
    near = dt < 0.2
    w_camera = log_so3(np.swapaxes(R[:-1], 1, 2) @ R[1:])[near] / dt[near, None]
    times = np.asarray(1e-9 * (images.samples.stamps_ns - images.stamps_ns[0]), np.float64)
    steps = 0.5 * np.diff(times)[:, None] * (images.samples.angular_velocity[1:] + images.samples.angular_velocity[:-1])
    turned = np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])
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
