"""Initial pose of the person in the first images, given by hand: ``start.yaml``.

    pelvis: [0.512, -0.034, 0.981, 0.017, 0.067, -0.030, 0.997]
    thigh_left: [x, y, z, qx, qy, qz, qw]

A line a segment: world_T_segment, its origin [m] and its rotation as a quaternion of any length, in the frame of the
file of static cameras. Not every segment must be there.
"""

import logging
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.checked_fields import numbers_of
from bodycam_ros.body_state import SegmentPose
from bodycam_ros.errors import BodyError
from bodycam_ros.estimation.initial_pose import first_poses
from bodycam_ros.files.shown import few, shown
from bodycam_ros.files.whole_file import write_whole
from bodycam_ros.files.yaml_file import read_yaml
from bodycam_ros.geometry import Array, quaternion_xyzw, rigid, rotation_from_xyzw
from bodycam_ros.static_cameras.articulated_step import ArticulatedStep

logger = logging.getLogger(__name__)

_WHAT = "file of where the person stands"
_MOST_NAMED = 10
_SHORTEST = 0.1  # quaternion: of the three digits that a person writes, a shorter one keeps two
_FARTHEST_M = 1000.0  # beyond it, millimetres were taken for metres

AUTO = Path("auto")
"""A start that is detected in the first images, or keypoints that are detected in all."""

NONE = Path("none")
"""No keypoints, although the start is detected."""

START_SIGMAS = np.repeat([0.12, 0.04], 3)
"""[rad], [m] of a segment that a person placed by hand."""

START_JOINT_RAD = float(np.sqrt(2.0)) * 0.12
"""Sigma of a joint between two segments that a person placed."""


@dataclass(frozen=True)
class StaticCameraFiles:
    """Files of static cameras.

    Attributes:
        stations: their poses and lenses.
        surface: folder of the segments' meshes; None for the body's own, or capsules.
        start: initial pose of the body, or ``AUTO``; None where body cameras measure it.
        keypoints: folder of 2-D keypoints of each camera, a file for each image, ``AUTO`` or ``NONE``; None for those
            that suit the start.
        person: which of the people it is, where the start is detected or keypoints: 1 for the one on whom the most
            keypoints of all cameras agree.
    """

    stations: Path
    surface: Path | None = None
    start: Path | None = None
    keypoints: Path | None = None
    person: int = 1

    @property
    def evidence(self) -> Path | None:
        """Keypoints that count in all images: with a detected start detected ones, unless others or none are given."""
        if self.keypoints is None and self.start == AUTO:
            return AUTO
        return None if self.keypoints == NONE else self.keypoints


@dataclass(frozen=True, eq=False)
class PlacedBody:
    """A body in the first frame.

    Attributes:
        world_T_segment: (S, 4, 4), joints closed.
        unplaced: (S,) segments without a given pose; they are in the N-pose until they are searched for.
    """

    world_T_segment: Array
    unplaced: NDArray[np.bool_]


def placed_body(start: Path, world_T_file: Array, body: BodyModel) -> PlacedBody:
    """The body in the first frame.

    Args:
        start: poses of segments, in the frame of the file of static cameras.
        world_T_file: (4, 4) that frame in the world.
        body: segments and joints.

    Raises:
        BodyError: the start cannot be used.
    """
    placed = {segment: world_T_file @ pose for segment, pose in read_start(start, body).items()}
    poses = start_poses(body, placed)
    # Hands were added at the ends of the forearms.
    known = {*placed, *(segment.replace("forearm", "hand") for segment in placed), *body.equipment_segments}
    unplaced = np.array([segment not in known for segment in body.segments])
    if unplaced.any():
        names = ", ".join(np.array(body.segments)[unplaced])
        logger.warning("%s: does not place %s; they are searched for in the first images", start, names)
    return PlacedBody(poses, unplaced)


def read_start(path: Path, body: BodyModel) -> dict[str, Array]:
    """Segment -> world_T_segment (4, 4), in the frame of the file of static cameras.

    Segments that the body does not have are left out, with a warning: a scan may have hands that the body has not.

    Raises:
        BodyError: the file cannot be read, is no table, places no segment of the person, or has a line that is not
            seven finite numbers with a quaternion of some length.
    """
    document = read_yaml(path, _WHAT, BodyError)
    if not isinstance(document, Mapping):
        raise BodyError(
            f"{path}: expected a table of segments, each with [x, y, z, qx, qy, qz, qw], not {shown(document)}"
        )
    person = [segment for segment in body.segments if segment not in body.equipment_segments]
    if not any(segment in document for segment in person):
        raise BodyError(
            f"{path}: places no segment of body {body.name}; expected some of {', '.join(person)}, and found "
            f"{_named(document)}"
        )
    if others := [name for name in document if name not in body.segments]:
        logger.warning("%s: leaves out %s, which body %s does not have", path, _named(others), body.name)
    return {
        segment: _pose(document[segment], f"{path}: segment {segment}")
        for segment in body.segments
        if segment in document
    }


def write_start(path: Path, file_T_segment: Mapping[str, Array]) -> None:
    """Write segment -> pose (4, 4) in the frame of the file of static cameras, as ``read_start`` reads it.

    Raises:
        OutputError: it cannot be written.
    """
    lines = []
    for segment, pose in file_T_segment.items():
        numbers = (*pose[:3, 3].tolist(), *quaternion_xyzw(pose[:3, :3]).tolist())
        lines.append(f"{segment}: [{', '.join(f'{number:.5f}' for number in numbers)}]\n")
    write_whole(path, "".join(lines))


def start_poses(body: BodyModel, placed: Mapping[str, Array]) -> Array:
    """Poses (S, 4, 4) of a whole body, joints closed, as near as can be to segments that were placed by hand.

    Segments that were not placed are in the N-pose. Those that were are all a little off, so root and
    joints are fitted to all of them together. Equipment beside the person stays where it was placed.

    Args:
        body: segments and joints.
        placed: segment -> world_T_segment (4, 4), one or more.
    """
    start = first_poses(body, [SegmentPose(name, pose, np.eye(6)) for name, pose in placed.items()])
    rows = [body.segment_index[name] for name in placed]
    information = np.tile(np.diag(START_SIGMAS**-2.0), (len(rows), 1, 1))
    return ArticulatedStep(body, obeys_limits=False).fit(start, rows, start[rows], information)


def placed_segments(body: BodyModel, poses: Array) -> list[SegmentPose]:
    """Measurements of the person's segments by a body placed by hand at poses (S, 4, 4)."""
    return [
        SegmentPose(segment, poses[row], np.diag(START_SIGMAS**2))
        for row, segment in enumerate(body.segments)
        if segment not in body.equipment_segments
    ]


def _pose(value: Any, where: str) -> Array:
    numbers = numbers_of(value, 7, where)
    position, quaternion = numbers[:3], numbers[3:]
    if np.linalg.norm(quaternion) < _SHORTEST:
        raise BodyError(f"{where}: its quaternion has no length; expected qx, qy, qz, qw; upright it is 0, 0, 0, 1")
    if np.abs(position).max() > _FARTHEST_M:
        raise BodyError(f"{where}: it is {np.linalg.norm(position):.4g} m away; expected metres")
    return rigid(rotation_from_xyzw(quaternion), position)


def _named(names: Collection[Any]) -> str:
    """Names as the file has them, not too many."""
    readable = (name if isinstance(name, str) and name.isprintable() else shown(name) for name in names)
    return few(readable, _MOST_NAMED) or "nothing"
