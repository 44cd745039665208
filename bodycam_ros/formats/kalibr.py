"""Kalibr's camchain YAML, as OpenVINS uses it too: lenses and poses of cameras that are fixed to each other.

A table per camera: ``camera_model`` pinhole with ``distortion_model`` radtan, equidistant (equi), fov or none,
``intrinsics`` fx, fy, cx, cy [px], ``distortion_coeffs``, ``resolution``, and its place: ``T_cam_imu`` (camera_T_imu),
``T_imu_cam`` (imu_T_camera) or ``T_cn_cnm1`` (this camera_T_the one before it). The world is the sensor's frame where
the file has it, else the first camera's; ``timeshift_cam_imu`` concerns clocks, which recordings tell by themselves.
"""

from collections.abc import Callable, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from bodycam_ros.camera import camera_from_info
from bodycam_ros.errors import StaticCameraError
from bodycam_ros.files.shown import shown
from bodycam_ros.files.yaml_file import yaml_document
from bodycam_ros.formats.calibration_fields import numbers_of_shape, rotation_of
from bodycam_ros.geometry import Array, inverse, rigid
from bodycam_ros.static_cameras.static_camera import StaticCamera

MARKS = ("camera_model", "intrinsics")
"""Fields that a camera of Kalibr has, and no other program's."""

_MODELS = {"radtan": "plumb_bob", "plumb_bob": "plumb_bob", "equidistant": "equidistant", "equi": "equidistant",
           "fov": "fov", "none": "plumb_bob", "": "plumb_bob"}  # fmt: skip
_COUNT = {"plumb_bob": 4, "equidistant": 4, "fov": 1}
_ROTATES = 1e-2


def kalibr_cameras(path: Path, text: str) -> dict[str, Mapping[str, Any]]:
    """The tables of the cameras of a camchain; none where the text is another file's.

    Raises:
        StaticCameraError: it is no YAML.
    """
    try:
        document = yaml_document(text, "calibration of cameras", StaticCameraError)
    except StaticCameraError as error:
        raise StaticCameraError(f"{path}: {error}") from error
    if not isinstance(document, Mapping):
        return {}
    tables = {str(key): table for key, table in document.items() if isinstance(table, Mapping)}
    return {name: table for name, table in tables.items() if all(mark in table for mark in MARKS)}


def read_kalibr(
    path: Path, cameras: Mapping[str, Mapping[str, Any]]
) -> Iterator[tuple[str, Callable[[], StaticCamera]]]:
    """Each camera's name, and what makes its station in the frame of the file [m], or raises StaticCameraError."""
    has_sensor = any("T_cam_imu" in table or "T_imu_cam" in table for table in cameras.values())
    before: Array | str = "has no camera before it" if has_sensor else np.eye(4)
    for name, table in cameras.items():
        where = f"{path}: camera {name}"
        pose: Array | str
        try:
            pose = _world_T_camera(table, where, before)
        except StaticCameraError as error:
            pose = str(error)
        yield name, partial(_station, name, table, where, pose)
        before = pose


def _world_T_camera(table: Mapping[str, Any], where: str, before: Array | str) -> Array:
    if "T_cam_imu" in table:
        return inverse(_pose(table["T_cam_imu"], f"{where}: T_cam_imu"))
    if "T_imu_cam" in table:
        return _pose(table["T_imu_cam"], f"{where}: T_imu_cam")
    if "T_cn_cnm1" in table:
        if isinstance(before, str):
            raise StaticCameraError(f"{where}: T_cn_cnm1 is from the camera before it, which cannot be used: {before}")
        return before @ inverse(_pose(table["T_cn_cnm1"], f"{where}: T_cn_cnm1"))
    if isinstance(before, str) or not np.array_equal(before, np.eye(4)):
        raise StaticCameraError(f"{where}: has no pose; expected T_cam_imu, T_imu_cam or T_cn_cnm1")
    return before  # the first of a chain without a sensor


def _pose(value: Any, where: str) -> Array:
    T = numbers_of_shape(value, (4, 4), where)
    return rigid(rotation_of(T[:3, :3], where, _ROTATES), T[:3, 3])


def _station(name: str, table: Mapping[str, Any], where: str, world_T_camera: Array | str) -> StaticCamera:
    if isinstance(world_T_camera, str):
        raise StaticCameraError(world_T_camera)
    kind, distortion = str(table["camera_model"]), str(table.get("distortion_model", "")).lower()
    if kind != "pinhole" or distortion not in _MODELS:
        raise StaticCameraError(
            f"{where}: camera_model {shown(kind)} with distortion_model {shown(distortion)} is not supported; "
            f"calibrate it as pinhole with radtan or equi"
        )
    model = _MODELS[distortion]
    D = numbers_of_shape(table.get("distortion_coeffs") or [0.0] * _COUNT[model], (-1,), f"{where}: distortion_coeffs")
    fx, fy, cx, cy = numbers_of_shape(table["intrinsics"], (4,), f"{where}: intrinsics").tolist()
    width, height = numbers_of_shape(table.get("resolution"), (2,), f"{where}: resolution").tolist()
    K = [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0]
    camera = camera_from_info(name, round(width), round(height), model, D.tolist(), K)
    return StaticCamera(name, world_T_camera, camera)
