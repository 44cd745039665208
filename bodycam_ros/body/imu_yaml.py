"""The calibration of a camera's inertial sensor as a table of a body file, under ``imu`` of its camera."""

from dataclasses import replace
from typing import Annotated, Any

import msgspec
import numpy as np

from bodycam_ros.body.checked_fields import Entry, Number, Point, Quaternion, pose_of, read_entry, rounded
from bodycam_ros.errors import BodyError
from bodycam_ros.geometry import quaternion_xyzw
from bodycam_ros.inertial.imu_calibration import ImuCalibration

_Offset = Annotated[float, msgspec.Meta(ge=-1.0, le=1.0)]  # a larger one is no delay of a sensor
_NUMBERS = ("gyro_bias", "gyro_scale", "accelerometer_bias", "accelerometer_scale")
_SIGMAS = ("rotation", "position", "time_offset", "gyro_bias", "gyro_scale", "accelerometer_bias")


class _ImuEntry(Entry):
    position: Point  # of the sensor in the camera's optical frame [m]
    quaternion_xyzw: Quaternion
    time_offset: _Offset  # sensor's stamp minus camera's stamp of the same moment [s]
    gyro_bias: Point  # [rad/s]
    gyro_scale: Point
    accelerometer_bias: Point  # [m/s^2]
    accelerometer_scale: Point
    sigmas: tuple[Number, Number, Number, Number, Number, Number]  # of _SIGMAS [rad], [m], [s], [rad/s], 1, [m/s^2]


def imu_of(entry: Any, where: str) -> ImuCalibration:
    """The calibration that a table describes.

    Raises:
        BodyError: it describes none; the message begins with ``where``.
    """
    imu: _ImuEntry = read_entry(_ImuEntry, entry, where)
    if min(*imu.sigmas, *imu.gyro_scale, *imu.accelerometer_scale) <= 0.0:
        raise BodyError(f"{where}: sigmas and scales must be positive")
    camera_T_imu = pose_of(imu.position, imu.quaternion_xyzw, f"{where}: quaternion_xyzw")
    values: dict[str, Any] = {name: np.array(getattr(imu, name)) for name in _NUMBERS}
    values |= {f"{name}_sigma": sigma for name, sigma in zip(_SIGMAS, imu.sigmas, strict=True)}
    return replace(ImuCalibration(camera_T_imu[:3, :3], camera_T_imu[:3, 3], imu.time_offset), **values)


def imu_entry(imu: ImuCalibration) -> dict[str, Any]:
    """A calibration as a table."""
    entry = _ImuEntry(
        position=rounded(imu.camera_p_imu),
        quaternion_xyzw=rounded(quaternion_xyzw(imu.camera_R_imu)),
        time_offset=rounded(np.array([imu.time_offset]))[0],
        sigmas=rounded(np.array([getattr(imu, f"{name}_sigma") for name in _SIGMAS])),
        **{name: rounded(getattr(imu, name)) for name in _NUMBERS},
    )
    table: dict[str, Any] = msgspec.to_builtins(entry)
    return table
