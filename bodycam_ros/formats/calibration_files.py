"""Calibrations of static cameras by other programs: anipose, FreeMoCap, Pose2Sim, Caliscope, Qualisys, OpenCV, Kalibr.

All are brought to metres and to world_T_camera of the optical frame (x right, y down, z forward). The world stays that
of the file.

- ``.toml``: a table per camera with size, matrix, distortions, and rotation (rotation vector or matrix) and translation
  of the world in the camera. ``units`` ("m", "cm", "mm") in the metadata wins over the guess by the cameras' distances.
- ``.qca.txt``: XML of Qualisys Track Manager; millimetres, pixels in 64ths, camera axes x right, y up, z backward.
- OpenCV's ``%YAML:1.0``: K_NAME, dist_NAME, Rot_NAME or R_NAME, T_NAME, W_NAME, H_NAME as of EasyMocap, in one file or
  in intri.yml and extri.yml beside each other.
- Kalibr's camchain, by ``kalibr``.

A camera that cannot be used is left out and named; a size that the file lacks is that of the images beside it.
"""

import logging
import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import cv2
import numpy as np

from bodycam_ros.body.urdf_xml import xml_elements
from bodycam_ros.camera import CameraModel, camera_from_info
from bodycam_ros.errors import BodyError, LensError, StaticCameraError
from bodycam_ros.files.merged_lines import merge_lines
from bodycam_ros.files.shown import shown
from bodycam_ros.files.yaml_file import read_bytes
from bodycam_ros.formats.calibration_fields import numbers_of_shape, rotation_of, size_of_images
from bodycam_ros.formats.kalibr import MARKS, kalibr_cameras, read_kalibr
from bodycam_ros.geometry import Array, exp_so3, inverse, log_so3, rigid
from bodycam_ros.static_cameras.static_camera import StaticCamera

logger = logging.getLogger(__name__)

TOML_MARK = "# Static cameras in metres, written by bodycam\n"
"""First line of a TOML file that we wrote."""

_UNITS_M = {"m": 1.0, "meters": 1.0, "metres": 1.0, "cm": 1e-2, "mm": 1e-3}
_KALIBR_UNIT = "m"
_LARGEST_M, _LARGEST_CM = 50.0, 1000.0
"""Distance between two cameras; a larger number is of a smaller unit."""

_SAME_FRAME_M, _SAME_FRAME_RAD = 0.2, 0.15
"""A camera this near to the world is its origin: adjustments move it from there by as much, and none looks upwards."""

_ROTATES = 1e-2  # entries of R^T R - 1: files have three digits or more
_LARGEST_TURN = 4.0 * np.pi  # [rad]; a larger number is in degrees, or damaged
_MOST_BYTES = 10_000_000
_QUALISYS_PIXEL = 1.0 / 64.0


def read_calibration(path: Path) -> dict[str, StaticCamera]:
    """Camera -> station, in the frame of the file [m].

    Raises:
        StaticCameraError: the file cannot be read, has no camera, or a field is missing or malformed.
        LensError: a lens is malformed.
    """
    content = read_bytes(path, "calibration of cameras", StaticCameraError, _MOST_BYTES)
    is_rig = False
    if path.name.endswith(".toml"):
        cameras, unit = _read_toml(path, content)
    elif path.name.endswith(".qca.txt"):
        cameras, unit = list(_read_qualisys(path, content)), "mm"
    else:
        cameras, unit = _read_yaml(path, content)
        is_rig = unit == _KALIBR_UNIT
    stations = _usable(path, cameras)
    places = np.array([station.world_T_camera[:3, 3] for station in stations])
    apart = float(np.linalg.norm(places[:, None] - places, axis=2).max())
    by = "as the file says" if unit else "by their distances"
    unit = unit or ("m" if apart <= _LARGEST_M else "cm" if apart <= _LARGEST_CM else "mm")
    scale = _UNITS_M[unit]
    logger.info(
        "%s: %d cameras up to %.2f m apart (%s, %s); z is taken for up", path, len(stations), scale * apart, unit, by
    )
    if own := next((station.name for station in stations if _is_world(station.world_T_camera, scale)), ""):
        logger.warning(
            "%s: its world is the frame of one camera, %s, whose z axis is not up; floor and up are unknown", path, own
        )
    elif is_rig:
        logger.warning("%s: its world is its inertial sensor's, whose z axis may not be up; floor is unknown", path)
    if len({station.name for station in stations}) < len(stations):
        raise StaticCameraError(f"{path}: two cameras have the same name; names must differ")
    poses = [rigid(station.world_T_camera[:3, :3], scale * station.world_T_camera[:3, 3]) for station in stations]
    return {station.name: replace(station, world_T_camera=pose) for station, pose in zip(stations, poses, strict=True)}


def _is_world(world_T_camera: Array, scale: float) -> bool:
    """Whether a camera's frame is the world, but for an adjustment of all cameras."""
    turned = float(np.linalg.norm(log_so3(world_T_camera[:3, :3])))
    return turned < _SAME_FRAME_RAD and scale * float(np.linalg.norm(world_T_camera[:3, 3])) < _SAME_FRAME_M


_Camera = tuple[str, Callable[[], StaticCamera]]
"""A camera's name, and what makes its station, or raises StaticCameraError or LensError."""


def _usable(path: Path, cameras: Sequence[_Camera]) -> list[StaticCamera]:
    """The stations that can be used; a warning names the others.

    Raises:
        StaticCameraError, LensError: there is none.
    """
    stations = list[StaticCamera]()
    faults = list[StaticCameraError | LensError]()
    left_out = list[str]()
    for name, make in cameras:
        try:
            stations.append(make())
        except (StaticCameraError, LensError) as error:
            # What is wrong with a lens is found without its file.
            faults.append(type(error)(f"{path}: {error}") if error.camera else error)
            left_out.append(name)
    if not stations:
        raise (
            faults[0]
            if faults
            else StaticCameraError(
                f"{path}: has no calibrated camera; expected size, matrix, rotation and translation of each"
            )
        )
    remarks = zip(left_out, faults, strict=True)
    for line in merge_lines(f"camera {shown(name)}: left out: {fault}" for name, fault in remarks):
        logger.warning("%s", line)
    return stations


def toml_text(stations: Iterable[StaticCamera]) -> str:
    """A calibration in TOML as anipose, Pose2Sim, FreeMoCap and Caliscope read it, in metres.

    Raises:
        LensError: TOML has no such lens model.
    """
    lines = [TOML_MARK.rstrip()]
    for number, station in enumerate(stations):
        camera, camera_T_world = station.camera, inverse(station.world_T_camera)
        if camera.distortion_model not in ("plumb_bob", "rational_polynomial", "equidistant"):
            raise LensError(f"TOML has no lens model {camera.distortion_model}", station.name)
        name = station.name.replace("\\", "\\\\").replace('"', '\\"')
        lines += [
            f"[cam_{number}]",
            f'name = "{name}"',
            f"size = [{camera.width}, {camera.height}]",
            f"matrix = {np.reshape(camera.k, (3, 3)).astype(float).tolist()}",
            f"distortions = {np.asarray(camera.distortion, float).tolist()}",
            f"rotation = {log_so3(camera_T_world[:3, :3]).tolist()}",
            f"translation = {camera_T_world[:3, 3].tolist()}",
            f"fisheye = {str(camera.distortion_model == 'equidistant').lower()}",
            "",
        ]
    return "\n".join([*lines, "[metadata]", "adjusted = false", "error = 0.0", 'units = "m"', ""])


def _read_toml(path: Path, content: bytes) -> tuple[list[_Camera], str]:
    """Cameras, and the unit of the file; empty where it has none. Caliscope has cameras one level down."""
    try:
        document = tomllib.loads(content.decode("utf-8-sig"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, RecursionError) as error:
        raise StaticCameraError(f"{path}: cannot be read as TOML: {error}") from error
    tables = _tables(document)
    unit = str(dict(tables).get("metadata", {}).get("units", ""))
    if unit and unit not in _UNITS_M:
        raise StaticCameraError(f"{path}: units must be one of {', '.join(_UNITS_M)}, not {shown(unit)}")
    tables += [inner for _, table in tables for inner in _tables(table)]
    cameras = list[_Camera]()
    for key, table in tables:
        if "matrix" in table:
            name = str(table.get("name") or (f"cam_{key}" if key.isdigit() else key))
            cameras.append((name, partial(_toml_station, path, name, table)))
    return cameras, unit


def _toml_station(path: Path, name: str, table: Mapping[str, Any]) -> StaticCamera:
    where = f"{path}: camera {name}"
    D = numbers_of_shape(table.get("distortions", [0.0] * 4), (-1,), f"{where}: distortions")
    pose, size = (table.get("rotation"), table.get("translation")), table.get("size") or size_of_images(path, name)
    numbers_of_shape(table["matrix"], (3, 3), f"{where}: matrix")
    if any(value in (None, "null", ["null"]) for value in pose):
        raise StaticCameraError(f"{where}: has no rotation and translation; its program could not place it")
    return _station(where, name, size, table["matrix"], D, *pose, bool(table.get("fisheye", False)))


def _tables(table: Mapping[str, Any]) -> list[tuple[str, Mapping[str, Any]]]:
    return [(key, value) for key, value in table.items() if isinstance(value, Mapping)]


def _read_qualisys(path: Path, content: bytes) -> Iterator[_Camera]:
    """Cameras of Qualisys."""
    try:
        root = xml_elements(content.decode("utf-8-sig"))
    except (BodyError, UnicodeDecodeError) as error:
        raise StaticCameraError(f"{path}: expected the calibration as Qualisys writes it: {error}") from error
    for element in root.iter("camera"):
        yield element.get("serial", ""), partial(_qualisys_station, path, element)


def _qualisys_station(path: Path, element: ElementTree.Element) -> StaticCamera:
    name = element.get("serial", "")
    where = f"{path}: camera {name}"

    def field(part: str, key: str) -> float:
        found = element.find(part)
        try:
            return float("" if found is None else found.get(key, ""))
        except ValueError as error:
            raise StaticCameraError(f"{where}: {part} lacks {key}; expected a number") from error

    try:
        is_rotated = float(element.get("viewrotation", "0")) % 360.0 != 0.0
    except ValueError as error:
        raise StaticCameraError(f"{where}: viewrotation is no number") from error
    if is_rotated:
        raise StaticCameraError(f"{where}: its view is rotated in Qualisys; export the calibration without rotation")
    width, height = (field("fov_video", high) - field("fov_video", low) + 1.0 for low, high in _FIELDS_OF_VIEW)
    fx, fy, cx, cy, k1, k2, p1, p2 = (_QUALISYS_PIXEL * field("intrinsic", key) for key in _INTRINSICS)
    cx, cy = cx - field("fov_video", "left"), cy - field("fov_video", "top")
    # Rows of the file are the axes of Qualisys' camera (x right, y up, z backward) in the world.
    axes = np.array([[field("transform", f"r{row}{column}") for column in "123"] for row in "123"])
    place = np.array([field("transform", axis) for axis in "xyz"])
    camera_R_world = axes * [[1.0], [-1.0], [-1.0]]
    K = [[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]]
    D = np.array([k1, k2, p1, p2])
    return _station(where, name, [width, height], K, D, camera_R_world, -camera_R_world @ place)


_FIELDS_OF_VIEW = (("left", "right"), ("top", "bottom"))
_INTRINSICS = (
    "focalLengthU", "focalLengthV", "centerPointU", "centerPointV", "radialDistortion1", "radialDistortion2",
    "tangentalDistortion1", "tangentalDistortion2",
)  # fmt: skip


def _read_yaml(path: Path, content: bytes) -> tuple[list[_Camera], str]:
    """Cameras of Kalibr, whose unit is the metre, or of OpenCV, and the unit."""
    if all(mark.encode() in content for mark in MARKS):
        try:
            text = content.decode("utf-8-sig")
        except UnicodeDecodeError as error:
            raise StaticCameraError(f"{path}: is not UTF-8") from error
        if tables := kalibr_cameras(path, text):
            return list(read_kalibr(path, tables)), _KALIBR_UNIT
    return list(_read_opencv(path)), ""


def _read_opencv(path: Path) -> Iterator[_Camera]:
    paths = [path]
    if path.stem in ("intri", "extri"):
        paths = [path.with_stem("intri"), path.with_stem("extri")]
    values: dict[str, Any] = {}
    for file in paths:
        if file.is_file():
            values |= _opencv_values(file)
    names = [key.removeprefix("K_") for key in values if key.startswith("K_")]
    if not names:
        raise StaticCameraError(
            f"{path}: has no K_NAME; expected K_, dist_, Rot_ (or R_), T_, W_ and H_ of each camera, as of EasyMocap, "
            "or a camchain of Kalibr; a lens alone (camera_info) does not say where a camera stands"
        )
    for name in names:
        yield name, partial(_opencv_station, path, name, values)


def _opencv_station(path: Path, name: str, values: Mapping[str, Any]) -> StaticCamera:
    where = f"{path}: camera {name}"
    rotation = values.get(f"Rot_{name}", values.get(f"R_{name}"))
    D = numbers_of_shape(np.ravel(values.get(f"dist_{name}", values.get(f"D_{name}", np.zeros(4)))), (-1,), where)
    size: list[Any] | None = [values.get(f"W_{name}"), values.get(f"H_{name}")]
    if None in (size or ()) and (size := size_of_images(path, name)) is None:
        raise StaticCameraError(
            f"{where}: has no size; expected W_{name} and H_{name} [px], or its images in images/{name}, or its video "
            f"videos/{name}.mp4, beside the file"
        )
    return _station(where, name, size, values[f"K_{name}"], D, rotation, values.get(f"T_{name}"))


def _opencv_values(path: Path) -> dict[str, Any]:
    """Matrices and numbers of a file of OpenCV; None of what is neither."""
    try:
        storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ)
        nodes = {key: storage.root().getNode(key) for key in storage.root().keys()}
    except (cv2.error, SystemError, UnicodeDecodeError) as error:
        raise StaticCameraError(f"{path}: cannot be read as YAML of OpenCV") from error
    values = {key: _opencv_value(node) for key, node in nodes.items()}
    storage.release()
    return values


def _opencv_value(node: cv2.FileNode) -> Any:
    try:
        return node.mat() if node.isMap() else node.real() if node.isInt() or node.isReal() else None
    except (cv2.error, SystemError):  # a table that is no matrix
        return None


def _station(
    where: str, name: str, size: Any, K: Any, D: Array, rotation: Any, translation: Any, fisheye: bool = False
) -> StaticCamera:
    """The station of a camera by camera_R_world, as a matrix or a rotation vector, and the translation with it."""
    size = numbers_of_shape(size, (2,), f"{where}: size")
    K = numbers_of_shape(K, (3, 3), f"{where}: matrix")
    rotation, translation = (np.ravel(np.asarray(value, object)).tolist() for value in (rotation, translation))
    if len(rotation) == 9:
        R = rotation_of(rotation, f"{where}: rotation", _ROTATES)
    else:
        vector = numbers_of_shape(rotation, (3,), f"{where}: rotation")
        if (angle := float(np.abs(vector).max())) > _LARGEST_TURN:
            raise StaticCameraError(f"{where}: rotation: expected an axis times an angle in radians, not {angle:g}")
        R = exp_so3(vector)
    t = numbers_of_shape(translation, (3,), f"{where}: translation")
    if not name or not name.isprintable():
        raise StaticCameraError(f"{where}: has no name")
    model, least = ("equidistant", 4) if fisheye else ("plumb_bob", 5) if len(D) <= 5 else ("rational_polynomial", 8)
    D = np.concatenate([D, np.zeros(max(0, least - len(D)))])[: 4 if fisheye else None]
    camera: CameraModel = camera_from_info(name, round(size[0]), round(size[1]), model, D.tolist(), K.ravel().tolist())
    return StaticCamera(name, inverse(rigid(R, t)), camera)
