"""Which point of another system is where on our body: what is known by name, and what a user's file says instead."""

from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from bodycam_ros.body.urdf import CAMERA_SUFFIX, optical_frame
from bodycam_ros.errors import RecordingError
from bodycam_ros.geometry import Array
from bodycam_ros.other_systems.captured_motion import CapturedMotion
from bodycam_ros.other_systems.known_names import Place, known_link
from bodycam_ros.shown import shown
from bodycam_ros.yaml_file import read_yaml

_FITTED = "fitted"
_MM_PER_M = 1000.0


def places_of(
    captured: CapturedMotion, links: Collection[str], joints: Mapping[str, str], names: Path | None
) -> dict[str, Place]:
    """Name of a point -> where it is on the body, of all points that are known or that a user's file names.

    The file is a table: name in the other system -> our segment, joint or camera (its centre), or
    ``{segment: S, at: [x, y, z]}`` (in the segment's axes [mm]), or ``{segment: S, at: fitted}`` (of a marker on it
    whose place nobody measured), or null (left out).

    Args:
        captured: the other system's motion.
        links: of the solved body.
        joints: our joint -> the segment that hangs on it.
        names: the user's file, if there is one.

    Raises:
        RecordingError: the file is malformed or names what is not there, or no point is known.
    """
    found: dict[str, Place] = {}
    for name in captured.points:
        if (known := known_link(name, links, joints, name in captured.rotations, captured.points)) is not None:
            link, is_centre = known
            found[name] = Place(link, np.zeros(3) if is_centre else None)
    if names is not None:
        found = {name: place for name, place in (found | _told(names, captured, links, joints)).items() if place}
    if not found:
        raise RecordingError(
            f"{captured.path}: none of its names is known ({_some(captured.points)}); say with --names MAP.yaml which "
            f"of our segments each is: {_some(link for link in links if not link.endswith(CAMERA_SUFFIX))}"
        )
    return found


def _told(
    path: Path, captured: CapturedMotion, links: Collection[str], joints: Mapping[str, str]
) -> dict[str, Place | None]:
    document = read_yaml(path, "table of names", RecordingError)
    if not isinstance(document, dict):
        raise RecordingError(f"{path}: expected a table, name in the other system -> our segment, joint or camera")
    told: dict[str, Place | None] = {}
    for name, value in document.items():
        if name not in captured.points:
            raise RecordingError(f"{path}: {captured.path.name} has no {shown(name)}; it has {_some(captured.points)}")
        told[str(name)] = None if value is None else _place(path, str(name), value, links, joints)
    return told


def _place(path: Path, name: str, value: Any, links: Collection[str], joints: Mapping[str, str]) -> Place:
    table = value if isinstance(value, dict) else {"segment": value}
    if not {"segment"} <= set(table) <= {"segment", "at"}:
        raise RecordingError(f"{path}: {shown(name)}: expected a segment, or a table of segment and at")
    word = str(table["segment"])
    link = next((link for link in (joints.get(word, word), optical_frame(word)) if link in links), None)
    if link is None:
        raise RecordingError(
            f"{path}: {shown(name)}: the body has no segment, joint or camera {shown(word)}; it has {_some(joints)}, "
            f"{_some(set(links) - set(joints.values()))}"
        )
    return Place(link, None if table.get("at") == _FITTED else _at(path, name, table.get("at", [0, 0, 0])))


def _at(path: Path, name: str, value: Any) -> Array:
    try:
        at = np.array(value, np.float64) / _MM_PER_M
        if at.shape != (3,) or not np.isfinite(at).all():
            raise ValueError
    except (TypeError, ValueError) as error:
        raise RecordingError(
            f"{path}: {shown(name)}: at: expected [x, y, z] in the segment's axes [mm], or {_FITTED}, "
            f"not {shown(value)}"
        ) from error
    return at


def _some(names: "Collection[str] | Any") -> str:
    listed = [str(name) for name in names]
    return ", ".join(listed[:20]) + (f" and {len(listed) - 20} more" if len(listed) > 20 else "")
