"""Stations as YAML: for each camera where it stands, and its lens with the fields of a sensor_msgs/CameraInfo.

    ext_00:
      T_map_cam: [[r, r, r, x], [r, r, r, y], [r, r, r, z], [0, 0, 0, 1]]     optical frame in the map [m]
      width: 640
      height: 480
      distortion_model: plumb_bob
      D: [k1, k2, p1, p2, k3]
      K: [fx, 0, cx, 0, fy, cy, 0, 0, 1]

``T_board_cam`` instead of ``T_map_cam`` says where cameras stand that were calibrated by the board; one file has one of
the two. Other fields, such as R and P, concern rectified images and are not read.
"""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.camera import CameraModel, camera_from_info
from bodycam_ros.errors import LensError, MapError, StationError
from bodycam_ros.geometry import Array, nearest_rotation, rigid
from bodycam_ros.recording.bag_file import BagFile
from bodycam_ros.registration.reference_map import MAP_R_BOARD, ReferenceMap
from bodycam_ros.shown import shown
from bodycam_ros.static_cameras.calibration_files import is_other_calibration, read_calibration, toml_text
from bodycam_ros.static_cameras.station import Station
from bodycam_ros.whole_file import write_whole
from bodycam_ros.yaml_file import read_yaml

_NO_ROTATION = 1e-6
_RESIDUAL = "board_residual"


def board_in_map(reference_map: ReferenceMap) -> Array | None:
    """map_T_board (4, 4), or None where the map was made without a board.

    Maps of before do not say how their board lay; most lie flat, and then the two frames are one.

    Raises:
        MapError: what the map says is no rotation.
    """
    summary = reference_map.summary
    if MAP_R_BOARD not in summary:
        return None if summary.get(_RESIDUAL, _RESIDUAL) is None else np.eye(4)
    if (axes := summary[MAP_R_BOARD]) is None:
        return None
    try:
        R = np.array(axes, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        R = np.zeros(0)
    if R.shape != (3, 3) or not np.abs(R.T @ R - np.eye(3)).max() < _NO_ROTATION or np.linalg.det(R) < 0.0:
        raise MapError(
            f"{MAP_R_BOARD} of the map must be a rotation, three rows of three, not {shown(axes)}; build the map again "
            "with 'bodycam map'"
        )
    return rigid(R, np.zeros(3))


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


def is_calibration(path: Path) -> bool:
    """Whether a path is a file of static cameras, and no recording."""
    return path.is_file() and (path.suffix.lower() in (".yaml", ".yml") or is_other_calibration(path))


def read_stations(path: Path, reference_map: ReferenceMap | None = None) -> dict[str, Station]:
    """Read a file of stations.

    Args:
        path: the file.
        reference_map: whose frame is the world, into which stations in the board's frame are brought. None where there
            is no map: the world is the frame that the file has.

    Returns:
        Camera -> station, in the order of the file.

    Raises:
        StationError: the file cannot be read, names no camera, lacks a field, or a pose is none; or it is in the frame
            of a board that the map does not know.
        LensError: a lens is malformed or of an unknown model.
        MapError: what the map says of its board is damaged.
    """
    if is_other_calibration(path):
        if reference_map is not None:
            raise StationError(
                f"{path}: the calibration of another program is in a frame of its own, not the map's; omit --map, "
                "or let 'bodycam stations' find the cameras in the map"
            )
        return read_calibration(path)
    document = read_yaml(path, _WHAT, StationError)
    if not isinstance(document, Mapping) or not document:
        raise StationError(
            f"{path}: names no camera; expected a table of cameras, each with {IN_MAP} or {IN_BOARD} and "
            f"{', '.join(_LENS)}"
        )
    frames = {name: _frame_of(entry, f"{path}: camera {shown(name)}") for name, entry in document.items()}
    if len(set(frames.values())) > 1:
        named = " and ".join(f"{frame} ({_first(frames, frame)})" for frame in (IN_MAP, IN_BOARD))
        raise StationError(f"{path}: cameras stand in different frames, {named}; expected one of the two for all")
    world_T_frame = np.eye(4)
    if reference_map is not None and IN_BOARD in frames.values():
        world_T_frame = _board_of(reference_map, path)
    return {name: _station(path, name, entry, frames[name], world_T_frame) for name, entry in document.items()}


def stations_text(stations: Iterable[Station]) -> str:
    """The text of a file of stations whose world is the map's frame; ``read_stations`` reads them back."""
    document = {station.name: _entry(station.world_T_camera, station.camera) for station in stations}
    return _TITLE + yaml.safe_dump(document, sort_keys=False, default_flow_style=None, width=1000)


def refuse_worn(path: Path, stations: Iterable[str], body: BodyModel) -> None:
    """Refuse static cameras that the body wears.

    Args:
        path: their file.
        stations: their names.
        body: with its equipment, if any.

    Raises:
        StationError: there is one.
    """
    if worn := sorted(set(stations) & set(body.mounts)):
        raise StationError(
            f"{path}: says where {', '.join(worn)} stands, but body {body.name} wears it; name static cameras "
            "otherwise, or take it out of one of the two"
        )


def write_stations(path: Path, stations: Iterable[Station], form: str = "yaml") -> None:
    """Write a file of stations, as ``yaml`` or ``toml``, whole or not at all.

    Raises:
        OutputError: it cannot be written.
    """
    write_whole(path, stations_text(stations) if form == "yaml" else toml_text(stations))


def _board_of(reference_map: ReferenceMap, path: Path) -> Array:
    map_T_board = board_in_map(reference_map)
    if map_T_board is None:
        raise StationError(
            f"{path}: says by {IN_BOARD} where cameras stand on the board, but the map was made without one; let "
            "'bodycam stations' find them in this map, or build it with photographs of the board"
        )
    return map_T_board


def _entry(world_T_camera: Array, camera: CameraModel) -> dict[str, Any]:
    return {
        IN_MAP: world_T_camera.tolist(),
        "width": camera.width,
        "height": camera.height,
        "distortion_model": camera.distortion_model,
        "D": [float(value) for value in camera.distortion],
        "K": [float(value) for value in camera.k],
    }


def _frame_of(entry: Any, where: str) -> str:
    """Which of the two poses an entry has, once it is known to have all fields."""
    if not isinstance(entry, Mapping):
        raise StationError(f"{where}: expected a table with {IN_MAP} and {', '.join(_LENS)}, not {shown(entry)}")
    poses = [frame for frame in (IN_MAP, IN_BOARD) if frame in entry]
    missing = [field for field in _LENS if field not in entry]
    if missing or not poses:
        lacks = [*([] if poses else [f"{IN_MAP} (or {IN_BOARD}), where it stands"]), *missing]
        raise StationError(f"{where}: lacks {', '.join(lacks)}")
    if len(poses) > 1:
        raise StationError(f"{where}: has {IN_MAP} and {IN_BOARD}; expected one of them")
    return poses[0]


def _first(frames: Mapping[Any, str], wanted: str) -> str:
    return shown(next(name for name, frame in frames.items() if frame == wanted))


def _station(path: Path, name: Any, entry: Mapping[str, Any], frame: str, world_T_frame: Array) -> Station:
    where = f"{path}: camera {shown(name)}"
    if not isinstance(name, str) or not 0 < len(name) <= _LONGEST_NAME or not name.isprintable():
        raise StationError(f"{where}: expected a name of at most {_LONGEST_NAME} printable characters, in quotes")
    frame_T_camera = _pose(entry[frame], f"{where}: {frame}")
    for field in ("width", "height"):
        if type(entry[field]) is not int:
            raise StationError(f"{where}: {field} must be a whole number of pixels, not {shown(entry[field])}")
    try:
        camera = camera_from_info(
            name, entry["width"], entry["height"], str(entry["distortion_model"]), entry["D"], entry["K"]
        )
    except LensError as error:
        raise LensError(f"{path}: {error}") from error
    return Station(name, world_T_frame @ frame_T_camera, camera)


def _pose(value: Any, where: str) -> Array:
    """The rigid transform (4, 4) of nested lists."""
    try:
        T = np.array([[float(number) for number in row] for row in value], dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        T = np.zeros(0)
    if T.shape != (4, 4):
        raise StationError(f"{where} must be four rows of four numbers, not {shown(value)}")
    if not np.isfinite(T).all():
        raise StationError(f"{where} must be finite, not {shown(value)}")
    if not np.array_equal(T[3], _LAST_ROW):
        raise StationError(f"{where}: the last row must be 0, 0, 0, 1, not {shown(T[3].tolist())}")
    R, t = T[:3, :3], T[:3, 3]
    off = float(np.abs(R.T @ R - np.eye(3)).max())
    if off > _ROTATES or np.linalg.det(R) < 0.0:
        what = "mirrors" if off <= _ROTATES else f"is no rotation (its columns are off by {off:.2g})"
        raise StationError(f"{where}: its upper left 3 x 3 {what}; expected the axes of the camera, of length 1 each")
    if np.abs(t).max() > _FARTHEST_M:
        raise StationError(f"{where}: the camera is {np.linalg.norm(t):.4g} m away; expected metres")
    return rigid(nearest_rotation(R), t)


_MAP_POINTS = "/map/points"


def check_stations_frame(stations: Path, solved: Path, map_path: Path | None) -> None:
    """Refuse stations on a board where the map, which knows where the board is, is not given, or another is the world.

    Args:
        stations: a file that ``read_stations`` takes.
        solved: the bag that a replay wrote.
        map_path: the map that it should have been solved in; None for none.

    Raises:
        StationError: so it is.
        RecordingError: not a bag.
    """
    if is_other_calibration(stations):
        return
    entries = read_yaml(stations, "file of static cameras", StationError).values()
    if not any(IN_BOARD in entry for entry in entries):
        return
    with BagFile(solved) as bag:
        in_map = bag.topics.get(_MAP_POINTS) is not None
    if in_map and map_path is None:
        raise StationError(
            f"{stations}: says by {IN_BOARD} where cameras stand, but {solved} was solved in a map; say with --map in "
            "which"
        )
    if map_path is not None and not in_map:
        raise StationError(f"{solved} was solved without a map, in the frame of {stations}: omit --map")
