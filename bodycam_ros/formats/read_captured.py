"""Readers of other systems' motions and joint points in all formats."""

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.errors import BodyError, RecordingError
from bodycam_ros.formats.bvh import read_bvh
from bodycam_ros.formats.c3d import read_c3d
from bodycam_ros.formats.captured_motion import CapturedMotion
from bodycam_ros.formats.csv import read_csv
from bodycam_ros.formats.start_points import place_points
from bodycam_ros.formats.static_cameras_file import world_T_file
from bodycam_ros.formats.trc import read_trc
from bodycam_ros.formats.tum import read_captured_tum
from bodycam_ros.geometry import Array
from bodycam_ros.static_cameras.start_file import PlacedBody, placed_body
from bodycam_ros.static_cameras.static_camera import StaticCamera

_READERS: Mapping[str, Callable[[Path], CapturedMotion]] = {
    ".bvh": read_bvh,
    ".c3d": read_c3d,
    ".trc": read_trc,
    ".tum": read_captured_tum,
    ".txt": read_captured_tum,
}
"""Suffix of a file -> its reader, which raises ValueError of what is damaged."""


def is_captured(path: Path) -> bool:
    """Whether a path is another system's: a file, or a folder with trajectories (``*.tum``) directly in it."""
    return not path.is_dir() or (any(path.glob("*.tum")) and not (path / "segments").is_dir())


def read_captured(path: Path) -> CapturedMotion:
    """Read a motion, by the suffix of its file.

    Raises:
        RecordingError: it does not exist, has an unknown suffix, or is damaged.
    """
    if not path.exists():
        raise RecordingError(f"{path}: does not exist")
    if path.is_dir():
        return read_captured_tum(path)
    read = _READERS.get(path.suffix.lower())
    if read is None:
        raise RecordingError(
            f"{path}: unknown format; known are {', '.join(_READERS)} (.txt: TUM), a folder of *.tum, and a "
            "recording's folder with ground truth"
        )
    try:
        return read(path)
    except ValueError as error:
        raise RecordingError(f"{path}: cannot be read as {path.suffix[1:].upper()}: {error}") from error


def read_joint_points(path: Path) -> Mapping[str, Array] | None:
    """Name -> points (K, 3) of TRC, C3D or CSV in the file's axes and unit, NaN where missing; None of other suffixes.

    Raises:
        BodyError: the file cannot be read.
    """
    suffix = path.suffix.lower()
    if suffix not in (".trc", ".c3d", ".csv"):
        return None
    try:
        return read_csv(path) if suffix == ".csv" else read_captured(path).points
    except RecordingError as error:
        raise BodyError(str(error)) from error


def read_start(start: Path, file: Path, stations: Mapping[str, StaticCamera], body: BodyModel) -> PlacedBody:
    """The body in the first image, by a start file in any format.

    Args:
        start: poses of segments, or points of joints.
        file: the stations' file, whose frame a start file of poses has.
        stations: of that file, in the world; one or more.
        body: segments and joints.

    Raises:
        BodyError: the start cannot be used.
        StaticCameraError: the stations cannot be read any more.
    """
    if (points := read_joint_points(start)) is None:
        return placed_body(start, world_T_file(file, stations), body)
    return PlacedBody(place_points(start, points, body, stations.values()), np.zeros(len(body.segments), bool))
