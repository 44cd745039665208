"""Readers of other systems' motions and joint points in all formats."""

import logging
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.errors import BodyError, RecordingError
from bodycam_ros.formats.bvh import read_bvh
from bodycam_ros.formats.c3d import read_c3d
from bodycam_ros.formats.captured_motion import CapturedMotion
from bodycam_ros.formats.csv import read_csv
from bodycam_ros.formats.gltf_motion import read_gltf
from bodycam_ros.formats.keypoints import JOINTS, is_keypoints, read_keypoints
from bodycam_ros.formats.motive import is_motive, read_motive
from bodycam_ros.formats.mvnx import read_mvnx
from bodycam_ros.formats.qualisys_tsv import read_qualisys
from bodycam_ros.formats.start_points import place_points, place_world_points
from bodycam_ros.formats.static_cameras_file import world_T_file
from bodycam_ros.formats.storage import read_storage
from bodycam_ros.formats.trc import read_trc
from bodycam_ros.formats.tum import read_captured_tum
from bodycam_ros.geometry import Array
from bodycam_ros.static_cameras.start_file import PlacedBody, placed_body
from bodycam_ros.static_cameras.static_camera import StaticCamera
from bodycam_ros.static_cameras.triangulated_joints import triangulate_person

logger = logging.getLogger(__name__)

_START_FRAMES = 5
"""Images from the first one on, of which the one with the most joints is the start: people move little meanwhile."""

_READERS: Mapping[str, Callable[[Path], CapturedMotion]] = {
    ".bvh": read_bvh,
    ".c3d": read_c3d,
    ".csv": read_motive,
    ".glb": read_gltf,
    ".gltf": read_gltf,
    ".mot": read_storage,
    ".mvnx": read_mvnx,
    ".sto": read_storage,
    ".trc": read_trc,
    ".tsv": read_qualisys,
    ".tum": read_captured_tum,
    ".txt": read_captured_tum,
}
"""Suffix of a file -> its reader, which raises ValueError of what is damaged."""

_NAMES = {".csv": "CSV of Motive", ".mot": "MOT", ".sto": "STO", ".tsv": "TSV of Qualisys", ".txt": "TUM"}
"""Suffix -> what else than the suffix a file of it has to be."""


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
            f"{path}: unknown format; known are {', '.join(_READERS)} (.txt: TUM, .csv: Motive, .tsv: Qualisys), a "
            "folder of *.tum, and a recording's folder with ground truth"
        )
    try:
        return read(path)
    except ValueError as error:
        kind = _NAMES.get(path.suffix.lower(), path.suffix[1:].upper())
        raise RecordingError(f"{path}: cannot be read as {kind}: {error}") from error


def read_joint_points(path: Path) -> Mapping[str, Array] | None:
    """Name -> points (K, 3) of a motion's file in its axes and unit, NaN where missing; None of other suffixes.

    Raises:
        BodyError: the file cannot be read.
    """
    suffix = path.suffix.lower()
    if suffix not in _READERS or suffix in (".tum", ".txt"):
        return None
    try:
        return read_csv(path) if suffix == ".csv" and not is_motive(path) else read_captured(path).points
    except RecordingError as error:
        raise BodyError(str(error)) from error


def read_start(start: Path, file: Path, stations: Mapping[str, StaticCamera], body: BodyModel) -> PlacedBody:
    """The body in the first image, by a start file in any format.

    Args:
        start: poses of segments, points of joints, or a folder of the cameras' keypoints.
        file: the stations' file, whose frame a start file of poses has.
        stations: of that file, in the world; one or more.
        body: segments and joints.

    Raises:
        BodyError: the start cannot be used.
        StaticCameraError: the stations cannot be read any more.
    """
    if is_keypoints(start):
        return place_world_points(start, _triangulated(start, stations), body)
    if (points := read_joint_points(start)) is None:
        return placed_body(start, world_T_file(file, stations), body)
    return PlacedBody(place_points(start, points, body, stations.values()), np.zeros(len(body.segments), bool))


def _triangulated(folder: Path, stations: Mapping[str, StaticCamera]) -> dict[str, Array]:
    """Joint -> its place (1, 3) in the world, by the keypoints of the first images.

    Raises:
        BodyError: the keypoints cannot be used.
    """
    frames = read_keypoints(folder, stations, _START_FRAMES)
    best = np.full((len(JOINTS), 3), np.nan)
    counts: NDArray[np.int64] = np.zeros(len(JOINTS), np.int64)
    for row in range(_START_FRAMES):
        people = {camera: read[row] for camera, read in frames.items() if row < len(read)}
        points, views = triangulate_person(stations, people)
        if np.isfinite(points[:, 0]).sum() > np.isfinite(best[:, 0]).sum():
            best, counts = points, views
    found = np.flatnonzero(np.isfinite(best[:, 0]))
    if not len(found):
        raise BodyError(f"{folder}: no two cameras agree on five joints of one person in the first images")
    logger.info("%s: %d of %d joints, by %g cameras each", folder, len(found), len(JOINTS), counts[found].mean())
    return {JOINTS[row]: best[row : row + 1] for row in found.tolist()}
