"""Equipment as YAML, for a person to write with a ruler in the other hand.

::

    name: bicycle
    root: frame
    upright: 3
    segments: {frame: {stands: true}, crank: {keeps_speed: true, angular_acceleration: 30}, pedal_left: {}}
    joints:
      axle: {parent: frame, child: crank, type: hinge, origin_in_parent: [0, 0, 0], axis: [0, 1, 0]}
      spindle_left: {parent: crank, child: pedal_left, type: hinge, origin_in_parent: [0.17, 0.12, 0], axis: [0, 1, 0],
        unknown: [5, 0, 0]}
    attachments:
      foot_on_pedal_left: {body: foot_left, equipment: pedal_left, weight: 2, holds: detected,
        points: [{body: [125, 0, -82], equipment: [0, 0, 0]}]}
    cameras:
      handlebar: {segment: frame, position: [0.5, 0.0, 0.7], quaternion_xyzw: [-0.5, 0.5, -0.5, 0.5]}

========================= ============================================================================================
of the equipment
========================= ============================================================================================
name                      its own; no joint or attachment may have the same
root                      the segment that carries the others
upright                   [deg] by how much the root's z axis may lean from the vertical; default: it may lie anyhow
segments                  name -> how it moves, below; names that no body has
joints                    as in a body file (``body_yaml``), places in metres; each segment but the root hangs on one.
                          ``unknown: [x, y, z]`` [mm], in the parent's axes: how far the joint may be from there.
                          ``turned_in_parent: [roll, pitch, yaw]`` [deg], about the parent's x, then y, then z, is
                          another way to write ``orientation_in_parent``
attachments               name -> where the body holds the equipment, below
cameras                   as in a body file, places in metres; default: none
========================= ============================================================================================

========================= ============================================================================================
of a segment
========================= ============================================================================================
stands                    true: it does not move in the world at all; the root only
keeps_speed               true: it keeps its speed while it is unobserved, as a wheel does; else it comes to rest
angular_acceleration      [rad/s^2] how suddenly its turning changes; default: as the body's segments
acceleration              [m/s^2] how suddenly its motion changes; default: as the body's segments
========================= ============================================================================================

========================= ============================================================================================
of an attachment
========================= ============================================================================================
body, equipment           a segment of each
points                    pairs of [x, y, z] [mm], ``body`` in the body's segment and ``equipment`` in the equipment's,
                          which should coincide. One pair holds a place, two leave the turn about their line, three or
                          more that lie apart hold everything
weight                    [mm] how far from each other the two of a pair may be: small is strong. Of all pairs, or
                          instead written into one
unknown                   [x, y, z] [mm] how far the equipment's points may be, all together, from where they are said
                          to be, in the equipment's segment; it is estimated. Default: they are known
holds                     ``detected`` (default): let go while what cameras see contradicts it; ``always``; or a list
                          of [from, until] [s] since the first image of the recording, until may be .inf
optional                  true: a body without the segment does without it
========================= ============================================================================================
"""

import math
from dataclasses import replace
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.body_yaml import joint_of, mount_of
from bodycam_ros.body.checked_fields import check_keys, name_of, number_of, numbers_of, table_of, truth_of
from bodycam_ros.body.equipment import Attachment, Equipment, Interval, SegmentMotion
from bodycam_ros.errors import BodyError
from bodycam_ros.geometry import Array, exp_so3, rigid
from bodycam_ros.kinematics.joint import FARTHEST_M, TIGHT_M, Joint
from bodycam_ros.shown import shown
from bodycam_ros.yaml_file import read_yaml

LEAST_UNKNOWN_MM = 1.0
"""Less than a ruler shows is known, or was written in metres."""

_MOST_PAIRS = 100
_MOST_INTERVALS = 1000
_LEAST_WEIGHT_MM, _MOST_WEIGHT_MM = 1e3 * TIGHT_M, 1000.0
_LEAST_PLACE_MM = 2.0
_MOST_MM = 1e3 * FARTHEST_M
_HOLDS = {"detected": True, "always": False}


def attachment_of(name: str, entry: Any) -> Attachment:
    """The attachment that a table describes.

    Raises:
        BodyError: it describes none; the message names the attachment.
    """
    where = f"attachment {name}"
    check_keys(entry, where, {"body", "equipment", "points"}, {"weight", "unknown", "holds", "optional"})
    pairs = entry["points"]
    if not isinstance(pairs, list) or not 1 <= len(pairs) <= _MOST_PAIRS:
        raise BodyError(
            f"{where}: points must be a list of 1 to {_MOST_PAIRS} pairs such as "
            f"{{body: [125, 0, -82], equipment: [0, 0, 0]}}, not {shown(pairs)}"
        )
    of_all = _weight(entry["weight"], where) if "weight" in entry else None
    on_body, on_equipment, sigmas = zip(
        *(_pair(pair, f"{where}: pair {number}", of_all) for number, pair in enumerate(pairs, 1)), strict=True
    )
    intervals, detected = _holds(entry.get("holds", "detected"), f"{where}: holds")
    return Attachment(
        name=name,
        body_segment=name_of(entry["body"], f"{where}: body"),
        equipment_segment=name_of(entry["equipment"], f"{where}: equipment"),
        on_body=1e-3 * np.array(on_body),
        on_equipment=1e-3 * np.array(on_equipment),
        sigmas=1e-3 * np.array(sigmas),
        unknown=1e-3 * lengths_of(entry.get("unknown", [0, 0, 0]), f"{where}: unknown", LEAST_UNKNOWN_MM),
        intervals=intervals,
        detected=detected,
        optional=truth_of(entry.get("optional", False), f"{where}: optional"),
    )


def lengths_of(value: Any, where: str, least_mm: float) -> Array:
    """Lengths (3) [mm], 0 or at least ``least_mm``.

    Raises:
        BodyError: they are not; those that are too small look like metres.
    """
    lengths = numbers_of(value, 3, where)
    if (lengths < 0.0).any() or (lengths > _MOST_MM).any():
        raise BodyError(f"{where} must be 0 to {_MOST_MM:g} mm along each axis, not {shown(value)}")
    if ((lengths > 0.0) & (lengths < least_mm)).any():
        raise BodyError(f"{where} is in millimetres, 0 or at least {least_mm:g}; {shown(value)} looks like metres")
    return lengths


def _pair(pair: Any, where: str, of_all: float | None) -> tuple[Array, Array, float]:
    """Points on the body and on the equipment (3) [mm], and the pair's weight [mm]."""
    check_keys(pair, where, {"body", "equipment"}, {"weight"})
    if "weight" not in pair and of_all is None:
        raise BodyError(f"{where}: lacks weight, how far from each other its points may be [mm]")
    weight = _weight(pair["weight"], where) if "weight" in pair else of_all
    assert weight is not None
    return _place(pair["body"], f"{where}: body"), _place(pair["equipment"], f"{where}: equipment"), weight


def _place(value: Any, where: str) -> Array:
    place = numbers_of(value, 3, where)
    far_mm = float(np.linalg.norm(place))
    if 0.0 < far_mm < _LEAST_PLACE_MM:
        raise BodyError(
            f"{where} is in millimetres, but {shown(value)} is {far_mm:.2g} mm from the segment's origin; "
            "it looks like metres"
        )
    if far_mm > _MOST_MM:
        raise BodyError(f"{where} is {far_mm:g} mm from the segment's origin; at most {_MOST_MM:g}")
    return place


def _weight(value: Any, where: str) -> float:
    return number_of(value, f"{where}: weight [mm]", _LEAST_WEIGHT_MM, _MOST_WEIGHT_MM)


def _holds(value: Any, where: str) -> tuple[tuple[Interval, ...] | None, bool]:
    """When it holds, None for always, and whether it is detected."""
    if isinstance(value, str) and value in _HOLDS:
        return None, _HOLDS[value]
    if not isinstance(value, list) or not 1 <= len(value) <= _MOST_INTERVALS:
        raise BodyError(
            f"{where} must be detected, always, or a list of intervals such as [[0, 3.2], [5, .inf]] [s], "
            f"not {shown(value)}"
        )
    intervals = tuple(_interval(each, where) for each in value)
    for before, after in zip(intervals, intervals[1:], strict=False):
        if after[0] < before[1]:
            raise BodyError(
                f"{where}: its intervals must follow each other, but {after[0]:g} s is before {before[1]:g} s"
            )
    return intervals, False


def _interval(value: Any, where: str) -> Interval:
    try:
        start, end = (float(bound) for bound in value if not isinstance(bound, bool))
    except (TypeError, ValueError, OverflowError):
        start = end = math.nan
    if not (math.isfinite(start) and start < end):
        raise BodyError(f"{where}: an interval is [from, until] [s], the earlier one first, not {shown(value)}")
    return start, end


_ENDINGS = (".yaml", ".yml")


def equipment_path(name_or_path: str | Path) -> Path:
    """The file of a supplied piece of equipment, or the file itself; a bare name is always of a supplied one.

    Raises:
        BodyError: none of that name is supplied; the message lists them.
    """
    path = Path(name_or_path)
    if path.name != str(name_or_path) or path.suffix.lower() in _ENDINGS:
        return path
    if path.name not in (supplied := supplied_equipment()):
        if not path.name:
            raise BodyError(
                f"no equipment is named; there are {', '.join(supplied)}, or give a file that ends in .yaml"
            )
        if path.exists():
            raise BodyError(f"{path}: an equipment file must end in .yaml; name it {path.stem}.yaml")
        raise BodyError(
            f"equipment {path.name}: none of that name is supplied; there are {', '.join(supplied)}. A file of yours "
            f"is named with its ending: {path.name}.yaml"
        )
    return _supplied_folder() / f"{path.name}.yaml"


def supplied_equipment() -> tuple[str, ...]:
    """Names of what the package supplies."""
    return tuple(sorted(path.stem for path in _supplied_folder().glob("*.yaml")))


def _supplied_folder() -> Path:
    # A link to config/equipment in the sources, a folder of the package wherever that is installed.
    return Path(str(files("bodycam_ros.body"))) / "supplied"


_MOST_PARTS = 100  # segments, joints, attachments, cameras
_MOST_LEANING_DEG = 90.0
_X, _Y, _Z = np.eye(3)


def read_equipment(name_or_path: str | Path) -> Equipment:
    """Read the description of a piece of equipment.

    Args:
        name_or_path: what is supplied, by its name (``equipment_yaml``), or a YAML file.

    Raises:
        BodyError: there is none of that name, the file is missing, or describes no equipment; the message names the
            file and the place in it.
    """
    path = equipment_path(name_or_path)
    document = read_yaml(path, "equipment file", BodyError)
    try:
        return _equipment(document)
    except BodyError as error:
        raise BodyError(f"{path}: {error}") from error


def _equipment(document: Any) -> Equipment:
    needed, optional = {"name", "root", "segments", "attachments"}, {"upright", "joints", "cameras"}
    check_keys(document, "an equipment file", needed, optional)
    name, root = name_of(document["name"], "name"), name_of(document["root"], "root")
    segments, joints, attachments, cameras = (
        # A name with nothing but comments after it is an empty table.
        table_of({} if (table := document.get(part)) is None else table, part, _MOST_PARTS)
        for part in ("segments", "joints", "attachments", "cameras")
    )
    equipment = Equipment(
        name=name,
        root=root,
        segments={name_of(segment, "segments"): _motion(segment, entry) for segment, entry in segments.items()},
        joints=tuple(_joint(name_of(joint, "joints"), entry) for joint, entry in joints.items()),
        attachments=tuple(attachment_of(name_of(each, "attachments"), entry) for each, entry in attachments.items()),
        unknown={joint: _unknown(joint, entry) for joint, entry in joints.items() if "unknown" in entry},
        upright_sigma=_upright(document["upright"]) if "upright" in document else np.inf,
        mounts={name_of(camera, "cameras"): mount_of(camera, entry) for camera, entry in cameras.items()},
    )
    _check_parts(equipment)
    return equipment


def _joint(name: str, entry: Any) -> Joint:
    joint = joint_of(name, entry, {"unknown", "turned_in_parent"})
    if "turned_in_parent" not in entry:
        return joint
    if "orientation_in_parent" in entry:
        raise BodyError(
            f"joint {name}: has turned_in_parent and orientation_in_parent, which say the same; leave out one"
        )
    roll, pitch, yaw = np.radians(numbers_of(entry["turned_in_parent"], 3, f"joint {name}: turned_in_parent"))
    turned = exp_so3(yaw * _Z) @ exp_so3(pitch * _Y) @ exp_so3(roll * _X)
    return replace(joint, parent_T_joint=rigid(turned, joint.parent_T_joint[:3, 3]))


def _motion(segment: str, entry: Any) -> SegmentMotion:
    where, entry = f"segment {segment}", {} if entry is None else entry
    check_keys(entry, where, set(), {"stands", "keeps_speed", "angular_acceleration", "acceleration"})
    stands = truth_of(entry.get("stands", False), f"{where}: stands")
    if stands and (idle := [key for key in entry if key != "stands"]):
        raise BodyError(f"{where}: it stands, and so has no {', '.join(idle)}; leave out the one or the other")
    sudden = {
        key: number_of(entry[key], f"{where}: {key}", least=0.01, most=1e4) if key in entry else None
        for key in ("angular_acceleration", "acceleration")
    }
    keeps_speed = truth_of(entry.get("keeps_speed", False), f"{where}: keeps_speed")
    return SegmentMotion(stands, keeps_speed, sudden["angular_acceleration"], sudden["acceleration"])


def _upright(value: Any) -> float:
    return float(np.radians(number_of(value, "upright [deg]", least=0.01, most=_MOST_LEANING_DEG)))


def _unknown(joint: str, entry: Any) -> Array:
    return 1e-3 * lengths_of(entry["unknown"], f"joint {joint}: unknown", LEAST_UNKNOWN_MM)


def _check_parts(equipment: Equipment) -> None:
    """Refuse parts that do not make one piece of equipment."""
    names = [equipment.name, *(joint.name for joint in equipment.joints), *(a.name for a in equipment.attachments)]
    if twice := sorted({name for name in names if names.count(name) > 1}):
        raise BodyError(
            f"{', '.join(twice)}: names must differ, for each attachment becomes a joint, and so does {equipment.name} "
            "itself, to the body"
        )
    if not equipment.attachments:
        raise BodyError("attachments: there is none, so nothing would couple a body to it")
    segments = tuple(equipment.segments)
    if equipment.root not in segments:
        raise BodyError(f"root {equipment.root} is not among the segments {', '.join(segments) or '(there are none)'}")
    if standing := [name for name, moves in equipment.segments.items() if moves.stands and name != equipment.root]:
        raise BodyError(f"segment {standing[0]}: stands, which only the root {equipment.root} can; weld it to the root")
    for attachment in equipment.attachments:
        if attachment.equipment_segment not in segments:
            raise BodyError(
                f"attachment {attachment.name}: equipment {attachment.equipment_segment} is not among the segments "
                f"{', '.join(segments)}"
            )
        if attachment.body_segment in segments:
            raise BodyError(
                f"attachment {attachment.name}: body {attachment.body_segment} is a segment of the equipment; it must "
                "be one of the body"
            )
    _check_carries(equipment)
    # One root, one tree, joints and cameras on segments that there are.
    BodyModel(equipment.name, equipment.root, segments, equipment.joints, equipment.mounts)


def _check_carries(equipment: Equipment) -> None:
    """What is unknown of a loop's joint could not be separated from the unknown lengths of the others around it."""
    carried: set[str] = set()
    for joint in equipment.joints:
        if _is_loop(joint, equipment.root, carried) and joint.name in equipment.unknown:
            raise BodyError(
                f"joint {joint.name}: unknown is for joints that carry their child, but it closes a loop: "
                f"{joint.child} hangs on another joint before it"
            )
        carried.add(joint.child)


def _is_loop(joint: Joint, root: str, carried: set[str]) -> bool:
    return joint.child == root or joint.child in carried
