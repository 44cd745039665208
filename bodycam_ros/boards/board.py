"""The file that describes an AprilTag board: where the corners of its tags are, and which of its axes points up."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bodycam_ros.boards.apriltag import FAMILIES
from bodycam_ros.errors import MapError
from bodycam_ros.files.shown import other_than, shown
from bodycam_ros.files.yaml_file import read_yaml
from bodycam_ros.geometry import Array, rotation_to_z

_LARGEST_M = 100.0
"""Bound of a coordinate: a board is smaller."""
_UNEVEN = 0.1
"""Sides and diagonals of a printed square differ by less than this share; one mistyped corner by more."""

_UP = re.compile(r"board (-?)([xyz]) is up")


@dataclass(frozen=True)
class Board:
    """A printed board of AprilTags.

    Attributes:
        family: AprilTag family.
        corners_board: tag -> (4, 3) corners [m] in the board frame, in the order of cv2.aruco.
        map_R_board: (3, 3) turns the board's upward axis to z; None if its placement does not define what is up.
    """

    family: str
    corners_board: Mapping[int, Array]
    map_R_board: Array | None


def read_board(path: Path) -> Board:
    """Read a board's description.

    The file gives ``family``, ``corners_in_board`` (tag -> four corners [m] in the order of cv2.aruco) and
    ``placement``, free text in which "board z is up" (or x, y, -x, ...) names the axis of the board that points up.

    Raises:
        MapError: the file is missing, not YAML, or lacks what it must have.
    """
    document = read_yaml(path, "board description", MapError)
    try:
        family = str(document["family"])
        corners = {int(tag): np.array(c, dtype=np.float64) for tag, c in document["corners_in_board"].items()}
        placement = str(document.get("placement", ""))
    except (TypeError, KeyError, ValueError, AttributeError, OverflowError) as error:
        problem = f"{error} is missing" if isinstance(error, KeyError) else shown(str(error))
        raise MapError(
            f"{path}: a board needs 'family' and 'corners_in_board' (tag: four corners [m]): {problem}"
        ) from error
    if family not in FAMILIES:
        raise MapError(f"{path}: there is no AprilTag family {shown(family)}; {other_than(family, FAMILIES)}")
    if not corners or any(c.shape != (4, 3) or not np.isfinite(c).all() for c in corners.values()):
        raise MapError(f"{path}: 'corners_in_board' must give each tag four corners of three finite numbers [m]")
    for tag, corners_tag in corners.items():
        if not _is_square(corners_tag):
            raise MapError(
                f"{path}: the corners of tag {tag} make no square; expected four corners [m] in order around the tag, "
                "in the order of cv2.aruco"
            )
    return Board(family, corners, _upright(placement))


def _is_square(corners: Array) -> bool:
    """Whether four corners (4, 3) are those of a square of a size that can be printed, in order around it."""
    if np.abs(corners).max() > _LARGEST_M:
        return False
    sides = np.linalg.norm(np.roll(corners, -1, axis=0) - corners, axis=1)
    diagonals = np.linalg.norm(corners[2:] - corners[:2], axis=1) / np.sqrt(2.0)
    lengths = np.concatenate([sides, diagonals])
    return bool(lengths.min() > 0.0 and np.ptp(lengths) <= _UNEVEN * lengths.max())


def _upright(placement: str) -> Array | None:
    """Rotation (3, 3) from board axes to axes with z up, or None if the placement does not name what is up."""
    match = _UP.search(placement)
    if match is None:
        return None
    up = np.eye(3)["xyz".index(match[2])]
    return rotation_to_z(-up if match[1] else up)
