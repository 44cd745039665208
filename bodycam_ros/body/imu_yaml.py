"""The calibration of a camera's inertial sensor as a table of a body file, under ``imu`` of its camera.

====================== ===============================================================================================
position, quaternion   of the sensor in the camera's optical frame [m], x y z w
time_offset            sensor's stamp minus camera's stamp of the same moment [s]
gyro_bias, _scale      of the angular velocity [rad/s], 1
accelerometer_bias     of the acceleration [m/s^2]; ``accelerometer_scale`` likewise
sigmas                 of rotation [rad], position [m], time_offset [s], gyro_bias [rad/s], gyro_scale,
                       accelerometer_bias [m/s^2], in this order
====================== ===============================================================================================
"""

from dataclasses import replace
from typing import Any

import numpy as np

from bodycam_ros.body.checked_fields import check_keys, number_of, numbers_of, pose_of
from bodycam_ros.errors import BodyError
from bodycam_ros.geometry import Array, quaternion_xyzw
from bodycam_ros.inertial.imu_calibration import ImuCalibration

_DECIMALS = 9
_LATEST_S = 1.0  # a larger time offset is no delay of a sensor
_NUMBERS = ("gyro_bias", "gyro_scale", "accelerometer_bias", "accelerometer_scale")
_KEYS = {"position", "quaternion_xyzw", "time_offset", "sigmas", *_NUMBERS}


def imu_of(entry: Any, where: str) -> ImuCalibration:
    """The calibration that a table describes.

    Raises:
        BodyError: it describes none; the message begins with ``where``.
    """
    check_keys(entry, where, _KEYS, set())
    camera_T_imu = pose_of(entry, "position", "quaternion_xyzw", where)
    sigmas = numbers_of(entry["sigmas"], 6, f"{where}: sigmas")
    gyro_bias, gyro_scale, accelerometer_bias, accelerometer_scale = (
        numbers_of(entry[name], 3, f"{where}: {name}") for name in _NUMBERS
    )
    if (sigmas <= 0.0).any() or min(gyro_scale.min(), accelerometer_scale.min()) <= 0.0:
        raise BodyError(f"{where}: sigmas and scales must be positive")
    calibration = ImuCalibration(
        camera_R_imu=camera_T_imu[:3, :3],
        camera_p_imu=camera_T_imu[:3, 3],
        time_offset=number_of(entry["time_offset"], f"{where}: time_offset", -_LATEST_S, _LATEST_S),
        gyro_bias=gyro_bias,
        gyro_scale=gyro_scale,
        accelerometer_bias=accelerometer_bias,
        accelerometer_scale=accelerometer_scale,
    )
    return replace(calibration, **dict(zip(_SIGMAS, sigmas.tolist(), strict=True)))


_SIGMAS = (
    "rotation_sigma",
    "position_sigma",
    "time_offset_sigma",
    "gyro_bias_sigma",
    "gyro_scale_sigma",
    "accelerometer_bias_sigma",
)


def imu_entry(imu: ImuCalibration) -> dict[str, Any]:
    """A calibration as a table."""
    return {
        "position": _rounded(imu.camera_p_imu),
        "quaternion_xyzw": _rounded(quaternion_xyzw(imu.camera_R_imu)),
        "time_offset": round(imu.time_offset, _DECIMALS),
        "gyro_bias": _rounded(imu.gyro_bias),
        "gyro_scale": _rounded(imu.gyro_scale),
        "accelerometer_bias": _rounded(imu.accelerometer_bias),
        "accelerometer_scale": _rounded(imu.accelerometer_scale),
        "sigmas": _rounded(np.array([getattr(imu, name) for name in _SIGMAS])),
    }


def _rounded(values: Array) -> list[float]:
    return [round(float(value), _DECIMALS) + 0.0 for value in values]
