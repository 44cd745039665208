"""Readers of other systems' motions and joint points in all formats."""

import logging
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.errors import BodyError, RecordingError
from bodycam_ros.files.shown import few
from bodycam_ros.formats.bvh import read_bvh
from bodycam_ros.formats.c3d import read_c3d
from bodycam_ros.formats.captured_motion import CapturedMotion
from bodycam_ros.formats.csv import read_csv
from bodycam_ros.formats.gltf_motion import read_gltf
from bodycam_ros.formats.keypoints import JOINTS, Frame, is_keypoints, read_keypoints
from bodycam_ros.formats.motive import is_motive, read_motive
from bodycam_ros.formats.mvnx import read_mvnx
from bodycam_ros.formats.qualisys_tsv import read_qualisys
from bodycam_ros.formats.start_points import place_points, place_world_points
from bodycam_ros.formats.static_cameras_file import world_T_file
from bodycam_ros.formats.storage import read_storage
from bodycam_ros.formats.trc import read_trc
from bodycam_ros.formats.tum import read_captured_tum
from bodycam_ros.geometry import Array
from bodycam_ros.static_cameras.start_file import AUTO, PlacedBody, placed_body
from bodycam_ros.static_cameras.static_camera import StaticCamera
from bodycam_ros.static_cameras.triangulated_joints import triangulate_people

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


def read_start(
    start: Path,
    file: Path,
    stations: Mapping[str, StaticCamera],
    body: BodyModel,
    person: int = 1,
    people: Mapping[str, Sequence[Frame]] | None = None,
) -> PlacedBody:
    """The body in the first image, by a start file in any format.

    Args:
        start: poses of segments, points of joints, a folder of the cameras' keypoints, or ``AUTO``.
        file: the stations' file, whose frame a start file of poses has.
        stations: of that file, in the world; one or more.
        body: segments and joints.
        person: which of the people in the keypoints it is; 1 is the one on whom the most agree.
        people: camera -> people in its first images, where the start is detected.

    Raises:
        BodyError: the start cannot be used.
        StaticCameraError: the stations cannot be read any more.
    """
    if start == AUTO and people is None:
        raise BodyError(
            "--start auto looks at the first images of a recorded bag; live, or for images of your own, make a start "
            "with 'bodycam view --place BAG --start auto'"
        )
    if start != AUTO and is_keypoints(start):
        people = read_keypoints(start, stations, _START_FRAMES)
    if people is not None:
        return place_world_points(start, _triangulated(start, people, stations, person), body)
    if person != 1:
        raise BodyError(f"{start}: has one person; --person is for --start auto and for a folder of keypoints")
    if (points := read_joint_points(start)) is None:
        return placed_body(start, world_T_file(file, stations), body)
    return PlacedBody(place_points(start, points, body, stations.values()), np.zeros(len(body.segments), bool))


def _triangulated(
    start: Path, people: Mapping[str, Sequence[Frame]], stations: Mapping[str, StaticCamera], person: int
) -> dict[str, Array]:
    """Joint -> its place (1, 3) in the world, by the keypoints of the first images.

    All are taken of one image, the same for each person: in another one their order may differ.

    Raises:
        BodyError: there are fewer people.
    """
    best: list[tuple[Array, NDArray[np.int64]]] = []
    for row in range(max(map(len, people.values()), default=0)):
        shown = {camera: frames[row] for camera, frames in people.items() if row < len(frames)}
        found = triangulate_people(stations, shown)
        if _known_joints(found) > _known_joints(best):
            best = found
    if not best:
        nobody = [camera for camera, frames in people.items() if not any(map(len, frames))]
        where = f" (nobody at all was found before {few(nobody, most=10)})" if nobody else ""
        raise BodyError(
            f"start {start}: no two cameras agree on five joints of one person in the first images{where}; check where "
            "the cameras are, or place the person with 'bodycam view --place BAG'"
        )
    if person > len(best):
        raise BodyError(
            f"start {start}: cameras agree on {len(best)} people in the first images, and --person is {person}"
        )
    points, counts = best[person - 1]
    known = np.flatnonzero(np.isfinite(points[:, 0]))
    logger.info("%s: %d of %d joints, by %g cameras each", start, len(known), len(JOINTS), counts[known].mean())
    if len(best) > 1:
        logger.warning(
            "start %s: cameras agree on %d people; person %d is followed, another one with --person",
            start,
            len(best),
            person,
        )
    return {JOINTS[row]: points[row : row + 1] for row in known.tolist()}


def _known_joints(people: Sequence[tuple[Array, NDArray[np.int64]]]) -> int:
    return sum(int(np.isfinite(points[:, 0]).sum()) for points, _ in people)
