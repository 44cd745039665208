"""Stations as YAML: for each camera where it stands, and its lens with the fields of a sensor_msgs/CameraInfo.

    ext_00:
      T_map_cam: [[r, r, r, x], [r, r, r, y], [r, r, r, z], [0, 0, 0, 1]]     optical frame in the map [m]
      width: 640
      height: 480
      distortion_model: plumb_bob
      D: [k1, k2, p1, p2, k3]
      K: [fx, 0, cx, 0, fy, cy, 0, 0, 1]

``T_board_cam`` instead of ``T_map_cam`` has the poses of cameras that were calibrated by the board; one file has one of
the two. Other fields, such as R and P, concern rectified images and are not read.
"""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.camera import camera_from_info
from bodycam_ros.errors import LensError, MapError, StaticCameraError
from bodycam_ros.files.shown import shown
from bodycam_ros.files.whole_file import write_whole
from bodycam_ros.files.yaml_file import read_yaml
from bodycam_ros.formats.calibration_fields import numbers_of_shape, rotation_of
from bodycam_ros.formats.calibration_files import read_calibration, toml_text
from bodycam_ros.formats.other_calibration import is_other_calibration
from bodycam_ros.geometry import Array, inverse, rigid
from bodycam_ros.recording.bag_file import BagFile
from bodycam_ros.registration.reference_map import MAP_R_BOARD, ReferenceMap
from bodycam_ros.static_cameras.static_camera import StaticCamera

IN_MAP, IN_BOARD = "T_map_cam", "T_board_cam"

MARK = "# Stations: "
"""How a file that we wrote begins."""

_LENS = ("width", "height", "distortion_model", "D", "K")
_TITLE = f"{MARK}static cameras, their optical frames in the frame of the map, and their lenses\n"
_WHAT = "file of static cameras"
_LONGEST_NAME = 100
_FARTHEST_M = 1000.0  # beyond it, millimetres were taken for metres
_ROTATES = 1e-3  # rounding of a matrix that was written with four digits
_LAST_ROW = (0.0, 0.0, 0.0, 1.0)
_MAP_POINTS = "/map/points"


def is_calibration(path: Path) -> bool:
    """Whether a path is a file of static cameras, and no recording."""
    return path.is_file() and (path.suffix.lower() in (".yaml", ".yml") or is_other_calibration(path))


def read_static_cameras(path: Path, reference_map: ReferenceMap | None = None) -> dict[str, StaticCamera]:
    """Read a file of stations.

    Args:
        path: the file.
        reference_map: whose frame is the world, into which stations in the board's frame are brought. None where there
            is no map: the world is the frame that the file has.

    Returns:
        Camera -> station, in the order of the file.

    Raises:
        StaticCameraError: the file cannot be read, names no camera, lacks a field, or a pose is none; or it is in the
            frame of a board that the map does not have.
        LensError: a lens is malformed or of an unknown model.
        MapError: the map's pose of its board is damaged.
    """
    if is_other_calibration(path):
        if reference_map is not None:
            raise StaticCameraError(
                f"{path}: the calibration of another program is in a frame of its own, not the map's; omit --map, "
                "or let 'bodycam stations' find the cameras in the map"
            )
        return read_calibration(path)
    document = read_yaml(path, _WHAT, StaticCameraError)
    if not isinstance(document, Mapping) or not document:
        raise StaticCameraError(
            f"{path}: names no camera; expected a table of cameras, each with {IN_MAP} or {IN_BOARD} and "
            f"{', '.join(_LENS)}"
        )
    frames = {_frame_of(entry, f"{path}: camera {shown(name)}") for name, entry in document.items()}
    if len(frames) > 1:
        raise StaticCameraError(
            f"{path}: some cameras have {IN_MAP}, others {IN_BOARD}; expected one of the two for all"
        )
    frame = frames.pop()
    world_T_frame = np.eye(4) if reference_map is None or frame == IN_MAP else _map_T_board(reference_map, path)
    return {name: _station(path, name, entry, frame, world_T_frame) for name, entry in document.items()}


def world_T_file(file: Path, stations: Mapping[str, StaticCamera]) -> Array:
    """(4, 4) frame of a file of stations in the world that its stations, one or more, were read into.

    Raises:
        StaticCameraError: the file cannot be read any more.
    """
    name, station = next(iter(stations.items()))
    in_file = read_static_cameras(file).get(name, station)  # cameras of other programs may have other names there
    return station.world_T_camera @ inverse(in_file.world_T_camera)


def write_static_cameras(path: Path, stations: Iterable[StaticCamera], form: str = "yaml") -> None:
    """Write a file of stations in the frame of the map, as ``yaml`` or ``toml``, whole or not at all.

    Raises:
        OutputError: it cannot be written.
    """
    if form == "toml":
        write_whole(path, toml_text(stations))
        return
    document = {
        station.name: {
            IN_MAP: station.world_T_camera.tolist(),
            "width": station.camera.width,
            "height": station.camera.height,
            "distortion_model": station.camera.distortion_model,
            "D": [float(value) for value in station.camera.distortion],
            "K": [float(value) for value in station.camera.k],
        }
        for station in stations
    }
    write_whole(path, _TITLE + yaml.safe_dump(document, sort_keys=False, default_flow_style=None, width=1000))


def refuse_body_cameras(path: Path, stations: Iterable[str], body: BodyModel) -> None:
    """Refuse static cameras of a file that the body wears.

    Raises:
        StaticCameraError: there is one.
    """
    if body_cameras := sorted(set(stations) & set(body.mounts)):
        raise StaticCameraError(
            f"{path}: has {', '.join(body_cameras)} as static camera, but it is on body {body.name}; give the static "
            "camera another name, or remove it from one of the two files"
        )


def check_static_cameras_frame(stations: Path, solved: Path, map_path: Path | None) -> None:
    """Refuse stations on a board where the map, which has the board's pose, is not given, or another is the world.

    Args:
        stations: a file that ``read_static_cameras`` takes.
        solved: the bag that a replay wrote.
        map_path: the map that it should have been solved in; None for none.

    Raises:
        StaticCameraError: so it is.
        RecordingError: not a bag.
    """
    if is_other_calibration(stations):
        return
    if not any(IN_BOARD in entry for entry in read_yaml(stations, _WHAT, StaticCameraError).values()):
        return
    with BagFile(solved) as bag:
        in_map = bag.topics.get(_MAP_POINTS) is not None
    if in_map and map_path is None:
        raise StaticCameraError(
            f"{stations}: has cameras by {IN_BOARD}, but {solved} was solved in a map; name it with --map"
        )
    if map_path is not None and not in_map:
        raise StaticCameraError(f"{solved} was solved without a map, in the frame of {stations}: omit --map")


def _map_T_board(reference_map: ReferenceMap, path: Path) -> Array:
    """Pose (4, 4) of the board in a map; in maps without ``map_R_board`` it lies flat, and the two frames are one."""
    summary = reference_map.summary
    axes = summary.get(MAP_R_BOARD, None if summary.get("board_residual", "") is None else np.eye(3))
    if axes is None:
        raise StaticCameraError(
            f"{path}: has cameras by {IN_BOARD}, but the map was made without a board; let 'bodycam stations' find "
            "them in this map, or build it with photographs of the board"
        )
    try:
        return rigid(rotation_of(axes, MAP_R_BOARD, _ROTATES), np.zeros(3))
    except StaticCameraError as error:
        raise MapError(f"{error}, in the map; build it again with 'bodycam map'") from error


def _frame_of(entry: Any, where: str) -> str:
    """Which of the two poses an entry has, once it is known to have all fields."""
    if not isinstance(entry, Mapping):
        raise StaticCameraError(f"{where}: expected a table with {IN_MAP} and {', '.join(_LENS)}, not {shown(entry)}")
    poses = [frame for frame in (IN_MAP, IN_BOARD) if frame in entry]
    lacks = [] if poses else [f"{IN_MAP} (or {IN_BOARD}), where it stands"]
    if lacks := lacks + [field for field in _LENS if field not in entry]:
        raise StaticCameraError(f"{where}: lacks {', '.join(lacks)}")
    if len(poses) > 1:
        raise StaticCameraError(f"{where}: has {IN_MAP} and {IN_BOARD}; expected one of them")
    return poses[0]


def _station(path: Path, name: Any, entry: Mapping[str, Any], frame: str, world_T_frame: Array) -> StaticCamera:
    where = f"{path}: camera {shown(name)}"
    if not isinstance(name, str) or not 0 < len(name) <= _LONGEST_NAME or not name.isprintable():
        raise StaticCameraError(f"{where}: expected a name of at most {_LONGEST_NAME} printable characters, in quotes")
    T = numbers_of_shape(entry[frame], (4, 4), f"{where}: {frame}")
    if not np.array_equal(T[3], _LAST_ROW):
        raise StaticCameraError(f"{where}: {frame}: the last row must be 0, 0, 0, 1, not {shown(T[3].tolist())}")
    if np.abs(T[:3, 3]).max() > _FARTHEST_M:
        raise StaticCameraError(
            f"{where}: {frame}: the camera is {np.linalg.norm(T[:3, 3]):.4g} m away; expected metres"
        )
    frame_T_camera = rigid(rotation_of(T[:3, :3], f"{where}: {frame}", _ROTATES), T[:3, 3])
    for field in ("width", "height"):
        if type(entry[field]) is not int:
            raise StaticCameraError(f"{where}: {field} must be a whole number of pixels, not {shown(entry[field])}")
    size = entry["width"], entry["height"]
    try:
        camera = camera_from_info(name, *size, str(entry["distortion_model"]), entry["D"], entry["K"])
    except LensError as error:
        raise LensError(f"{path}: {error}") from error
    return StaticCamera(name, world_T_frame @ frame_T_camera, camera)
