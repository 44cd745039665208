"""Scale and vertical of a map from the accelerometers of cameras that are registered in it.

Linear least squares over scale, gravity, biases and lever arms, as in visual-inertial initialisation (Mur-Artal and
Tardos 2017, "Visual-inertial monocular SLAM with map reuse", section IV): in each window of time the registered
positions of a camera are those of its twice integrated accelerometer, up to a start and a velocity.
"""

import logging
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.errors import MapError, RangeOfMotionError
from bodycam_ros.geometry import Array, nearest_rotation
from bodycam_ros.inertial.imu_calibrator import calibrate_imu
from bodycam_ros.inertial.imu_samples import GRAVITY, ImuSamples
from bodycam_ros.inertial.preintegration import SensorMotion, integrate

logger = logging.getLogger(__name__)

RegisteredPoses = tuple[NDArray[np.int64], Array]
"""(T,) stamps [ns] and (T, 4, 4) world_T_camera of a camera's registered images, in order of time."""

_WINDOW_NS = 4_000_000_000  # longer ones carry more scale and more noise: sigma 0.32 % at 2 s, 0.17 at 4, 0.18 at 6
_MIN_IMAGES = 12  # of a window
_POSITION_SIGMA_M = 3e-3  # of a registration
_LEVER_SIGMA_M, _BIAS_SIGMA, _SCALE_SIGMA = 0.03, 0.1, 0.006  # of a sensor's place, bias [m/s^2] and scale
_ITERATIONS = 8
_OF_SENSOR = 7  # lever arm, bias, scale
_MAX_SCALE_SIGMA = 0.03
_SHARED = 3.0  # errors of neighbouring registrations are alike: sigmas grow by so much


@dataclass(frozen=True, eq=False)
class InertialAlignment:
    """Scale and vertical.

    Attributes:
        scale: metres per unit of the map.
        scale_sigma: relative.
        up: (3,) unit vector against gravity, in the map.
        tilt_sigma: of that vector [rad].
        cameras: number of cameras whose sensors contributed.
    """

    scale: float
    scale_sigma: float
    up: Array
    tilt_sigma: float
    cameras: int


@dataclass(frozen=True, eq=False)
class _Window:
    """Equations (3 N) of one window: columns of unit, gravity (3), lever arm (3), bias (3) and scale of its sensor."""

    camera: int
    columns: Array
    right: Array


def align_to_gravity(poses: Mapping[str, RegisteredPoses], imus: Mapping[str, ImuSamples]) -> InertialAlignment:
    """Find metres and the vertical of a map.

    Args:
        poses: camera -> its registered images; the unit of the map may be wrong by a third.
        imus: camera -> samples of its sensor.

    Raises:
        MapError: no sensor can be used, or the motion does not determine the scale.
    """
    windows: list[_Window] = []
    cameras = 0
    for camera in poses.keys() & imus.keys():
        try:
            found = calibrate_imu(camera, *poses[camera], imus[camera])
        except RangeOfMotionError as error:
            logger.warning("inertial sensor not used: %s", error)
            continue
        # Its accelerometer was compared with a map whose scale and vertical were wrong.
        calibration = replace(found, accelerometer_bias=np.zeros(3), accelerometer_scale=np.ones(3))
        windows += _windows(cameras, *poses[camera], calibration.correct(imus[camera]))
        cameras += 1
    if not windows:
        raise MapError(
            "no inertial sensor agrees with the images, so the map has no scale and no vertical; give a board or a "
            "known distance"
        )
    alignment = _solve(windows, cameras)
    if alignment.scale_sigma > _MAX_SCALE_SIGMA:
        raise MapError(
            f"the accelerometers determine the map's scale to {100 * alignment.scale_sigma:.0f} % only; move faster, "
            "or give a board or a known distance"
        )
    return alignment


def _windows(camera: int, stamps_ns: NDArray[np.int64], world_T_camera: Array, samples: ImuSamples) -> list[_Window]:
    """Equations of all windows of a camera; ``samples`` are in camera axes, by the camera's clock."""
    motion = SensorMotion()
    motion.add(samples)
    covered = [motion.between(stamp_ns, stamp_ns) is not None for stamp_ns in stamps_ns.tolist()]
    stamps_ns, world_T_camera = stamps_ns[covered], world_T_camera[covered]
    windows = []
    for number in np.unique(stamps_ns // _WINDOW_NS):
        rows = np.flatnonzero(stamps_ns // _WINDOW_NS == number)
        if len(rows) < _MIN_IMAGES or motion.between(int(stamps_ns[rows[0]]), int(stamps_ns[rows[-1]])) is None:
            continue
        sums_R_camera, once, twice, _ = integrate(samples, stamps_ns[rows])
        R = world_T_camera[rows, :3, :3]
        t = 1e-9 * (stamps_ns[rows] - stamps_ns[rows[0]])
        world_R_sums = nearest_rotation((R @ np.swapaxes(sums_R_camera, 1, 2)).mean(axis=0))
        moved = twice - twice[0] - t[:, None] * once[0]
        by_bias = world_R_sums @ moved[:, :9].reshape(-1, 3, 3)
        by_force = (world_R_sums @ moved[:, 9:, None])[..., 0]
        # p = start + velocity t + unit (by_force + g t^2 / 2 - R lever - by_bias b - by_force e), unit: map per metre
        columns = np.concatenate(
            [
                by_force[:, :, None],
                0.5 * t[:, None, None] ** 2 * np.eye(3),
                -R,
                -by_bias,
                -by_force[:, :, None],
                world_T_camera[rows, :3, 3:],
            ],
            axis=2,
        )
        # Start and velocity are free: what is linear in time is removed.
        basis = np.linalg.qr(np.column_stack([np.ones(len(t)), t]))[0]
        flat = columns.reshape(len(t), -1)
        columns = (flat - basis @ (basis.T @ flat)).reshape(-1, columns.shape[2])
        windows.append(_Window(camera, columns[:, :-1], columns[:, -1]))
    return windows


def _solve(windows: list[_Window], cameras: int) -> InertialAlignment:
    """Iterate gravity to its known length, and down-weight windows that do not fit (Cauchy).

    Registrations err by more than integrated samples, so it is positions that are explained: what is solved for is the
    map's units per metre, and all else in these units.
    """
    count = 4 + _OF_SENSOR * cameras
    sensor_prior = np.concatenate([np.full(3, _LEVER_SIGMA_M), np.full(3, _BIAS_SIGMA), [_SCALE_SIGMA]]) ** -2.0
    prior = np.diag(np.concatenate([np.full(4, 1e-9), np.tile(sensor_prior, cameras)]))
    weights, T = np.ones(len(windows)), np.eye(count)
    for _ in range(_ITERATIONS):
        information, vector = prior.copy(), np.zeros(count)
        for window, weight in zip(windows, weights, strict=True):
            rows, A = _rows(window.camera), window.columns / _POSITION_SIGMA_M
            information[np.ix_(rows, rows)] += weight * A.T @ A
            vector[rows] += weight * A.T @ (window.right / _POSITION_SIGMA_M)
        reduced = T.T @ information @ T
        solution = T @ np.linalg.solve(reduced, T.T @ vector)
        errors = [np.sum((w.columns @ solution[_rows(w.camera)] - w.right) ** 2) / len(w.right) for w in windows]
        squares = np.array(errors) / _POSITION_SIGMA_M**2
        weights = 1.0 / (1.0 + squares / max(float(np.median(squares)), 1e-12))
        # Gravity is free at first. Then it has its length, and two tangent directions are free.
        direction = solution[1:4] / np.linalg.norm(solution[1:4])
        T = np.delete(np.eye(count), 1, axis=1)
        T[1:4, 0], T[1:4, 1:3] = GRAVITY * direction, np.linalg.svd(direction[None])[2][1:].T
    covariance = np.linalg.inv(reduced) * max(1.0, float(np.average(squares, weights=weights)))
    units = float(solution[0])
    return InertialAlignment(
        scale=1.0 / units,
        scale_sigma=_SHARED * float(np.sqrt(covariance[0, 0])) / units,
        up=np.asarray(-direction, np.float64),
        tilt_sigma=_SHARED * float(np.sqrt(np.trace(covariance[1:3, 1:3]))) / (GRAVITY * units),
        cameras=cameras,
    )


def _rows(camera: int) -> NDArray[np.int64]:
    """Unknowns of a window: scale, gravity, and those of its camera's sensor."""
    first = 4 + _OF_SENSOR * camera
    return np.concatenate([np.arange(4), np.arange(first, first + _OF_SENSOR)])
