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

Joints and cameras are as in a body file, in metres; points and unknown lengths are in millimetres.
"""

import logging
from dataclasses import replace
from importlib.resources import files
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any

import msgspec
import numpy as np

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.body_yaml import JointEntry, joint_of, mount_of
from bodycam_ros.body.checked_fields import UNTURNED, Entry, Name, Point, read_entry
from bodycam_ros.body.equipment import Attachment, Equipment, Interval, SegmentMotion
from bodycam_ros.errors import BodyError
from bodycam_ros.files.shown import other_than, shown
from bodycam_ros.files.yaml_file import read_yaml
from bodycam_ros.geometry import Array, exp_so3, rigid
from bodycam_ros.kinematics.joint import FARTHEST_M, TIGHT_M, Joint

logger = logging.getLogger(__name__)

_MOST_PARTS = 100  # segments, joints, attachments, cameras, pairs of an attachment
_LEAST_UNKNOWN_MM = 1.0  # less than a ruler shows is known, or was written in metres
_CENTIMETRES_MM = 60.0  # no equipment is held so near to the joints: a hand is 300 from the elbow
_LEAST_PLACE_MM = 2.0  # a point nearer to its segment's origin was written in metres
_MOST_MM = 1e3 * FARTHEST_M
_HOLDS = {"detected": True, "always": False}
_ENDINGS = (".yaml", ".yml")

_Weight = Annotated[float, msgspec.Meta(ge=1e3 * TIGHT_M, le=1000.0)]
_Millimetres = Annotated[float, msgspec.Meta(ge=0.0, le=_MOST_MM)]
_Lengths = tuple[_Millimetres, _Millimetres, _Millimetres]


class _EquipmentEntry(Entry):
    name: Name  # no joint or attachment may have the same
    root: Name  # the segment that carries the others
    segments: dict[Name, Any] | None  # names that no body has
    attachments: dict[Name, Any] | None
    # [deg] by how much the root's z axis may lean from the vertical; without, it may lie anyhow.
    upright: Annotated[float, msgspec.Meta(ge=0.01, le=90.0)] | None = None
    joints: dict[Name, Any] | None = None  # each segment but the root hangs on one
    cameras: dict[Name, Any] | None = None


class _JointEntry(JointEntry):
    unknown: _Lengths | None = None  # [mm] in the parent's axes: how far the joint may be from there
    turned_in_parent: Point | None = None  # [deg] about the parent's x, then y, then z, for orientation_in_parent


class _PairEntry(Entry):
    body: Point  # [mm] in the body's segment
    equipment: Point  # [mm] in the equipment's segment, which should coincide with it
    weight: _Weight | None = None  # [mm] instead of the attachment's


class _AttachmentEntry(Entry):
    body: Name  # a segment of each
    equipment: Name
    # One pair fixes a place, two leave the turn about their line, three or more that lie apart fix everything.
    points: Annotated[list[_PairEntry], msgspec.Meta(min_length=1, max_length=_MOST_PARTS)]
    weight: _Weight | None = None  # [mm] how far from each other the two of a pair may be: small is strong
    unknown: _Lengths = (0.0, 0.0, 0.0)  # [mm] how far the equipment's points may be, all together; it is estimated
    # "detected": released while cameras contradict it; "always"; or [from, until] [s] since the first image.
    holds: str | Annotated[list[Interval], msgspec.Meta(min_length=1, max_length=1000)] = "detected"
    optional: bool = False  # a body without the segment does without it


def equipment_path(name_or_path: str | Path) -> Path:
    """The file of a supplied piece of equipment, or the file itself; a bare name is always of a supplied one.

    Raises:
        BodyError: none of that name is supplied; the message lists them.
    """
    path = Path(name_or_path)
    if path.name != str(name_or_path) or path.suffix.lower() in _ENDINGS:
        return path
    if path.name not in (supplied := supplied_equipment()):
        raise BodyError(
            f"equipment {path.name or '(no name)'}: none of that name is supplied; {other_than(path.name, supplied)} "
            f"(a file of yours is named with its ending: {path.stem or 'mine'}.yaml)"
        )
    return _supplied_folder() / f"{path.name}.yaml"


def supplied_equipment() -> tuple[str, ...]:
    """Names of what the package supplies."""
    return tuple(sorted(path.stem for path in _supplied_folder().glob("*.yaml")))


def _supplied_folder() -> Path:
    # A link to config/equipment in the sources, a folder of the package wherever that is installed.
    return Path(str(files("bodycam_ros.body"))) / "supplied"


def read_equipment(name_or_path: str | Path) -> Equipment:
    """Read the description of a piece of equipment.

    Args:
        name_or_path: what is supplied, by its name, or a YAML file.

    Raises:
        BodyError: there is none of that name, the file is missing, or describes no equipment; the message names the
            file and the place in it.
    """
    path = equipment_path(name_or_path)
    document = read_yaml(path, "equipment file", BodyError)
    try:
        equipment = _equipment(read_entry(_EquipmentEntry, document, "an equipment file"))
    except BodyError as error:
        raise BodyError(f"{path}: {error}") from error
    for doubt in _doubts(equipment):
        logger.warning("%s: %s", path, doubt)
    return equipment


def _doubts(equipment: Equipment) -> list[str]:
    """What is possible, but hardly meant."""
    doubts, attachments = [], equipment.attachments
    points = np.concatenate([side for each in attachments for side in (each.on_body, each.on_equipment)])
    farthest_mm = 1e3 * float(np.linalg.norm(points, axis=1).max())
    if 0.0 < farthest_mm < _CENTIMETRES_MM:
        doubts.append(
            f"all points of attachments are within {farthest_mm:.0f} mm of the origins of their segments, as if they "
            "were in centimetres; write millimetres"
        )
    if len({each.equipment_segment for each in attachments}) == 1:
        common = np.all([each.unknown > 0.0 for each in attachments], axis=0)
        if common.any():
            axes = ", ".join(axis for axis, is_common in zip("xyz", common, strict=True) if is_common)
            segment = attachments[0].equipment_segment
            doubts.append(
                f"attachments {', '.join(each.name for each in attachments)}: unknown is above 0 along {axes} in all "
                f"of them, so nothing tells where {segment} is along it; give one of them 0 there"
            )
    return doubts


def _equipment(entry: _EquipmentEntry) -> Equipment:
    # A name with nothing but comments after it is an empty table.
    tables = [entry.segments or {}, entry.joints or {}, entry.attachments or {}, entry.cameras or {}]
    if max(map(len, tables)) > _MOST_PARTS:
        raise BodyError(f"more than {_MOST_PARTS} segments, joints, attachments or cameras")
    segments, given, attachments, cameras = tables
    joints = {name: read_entry(_JointEntry, each, f"joint {name}") for name, each in given.items()}
    equipment = Equipment(
        name=entry.name,
        root=entry.root,
        segments={name: _motion(each or {}, f"segment {name}") for name, each in segments.items()},
        joints=tuple(_joint(name, each) for name, each in joints.items()),
        attachments=tuple(attachment_of(name, each) for name, each in attachments.items()),
        unknown={
            name: _unknown(each.unknown, f"joint {name}") for name, each in joints.items() if each.unknown is not None
        },
        upright_sigma=np.inf if entry.upright is None else float(np.radians(entry.upright)),
        mounts={camera: mount_of(camera, each) for camera, each in cameras.items()},
    )
    _check_parts(equipment)
    return equipment


def attachment_of(name: str, entry: Any) -> Attachment:
    """The attachment that a table describes.

    Raises:
        BodyError: it describes none; the message names the attachment.
    """
    where = f"attachment {name}"
    attachment: _AttachmentEntry = read_entry(_AttachmentEntry, entry, where)
    sigmas = [pair.weight or attachment.weight for pair in attachment.points]
    for number, (pair, sigma) in enumerate(zip(attachment.points, sigmas, strict=True), 1):
        if sigma is None:
            raise BodyError(f"{where}: pair {number}: lacks weight, how far from each other its points may be [mm]")
        for point, side in ((pair.body, "body"), (pair.equipment, "equipment")):
            if not (0.0 == (far := float(np.linalg.norm(point))) or _LEAST_PLACE_MM <= far <= _MOST_MM):
                raise BodyError(
                    f"{where}: pair {number}: {side} is in millimetres, but {shown(point)} is {far:.2g} mm from the "
                    f"segment's origin; expected 0, or {_LEAST_PLACE_MM:g} to {_MOST_MM:g}; check its unit"
                )
    intervals, detected = _holds(attachment.holds, f"{where}: holds")
    return Attachment(
        name=name,
        body_segment=attachment.body,
        equipment_segment=attachment.equipment,
        on_body=1e-3 * np.array([pair.body for pair in attachment.points]),
        on_equipment=1e-3 * np.array([pair.equipment for pair in attachment.points]),
        sigmas=1e-3 * np.array(sigmas, np.float64),
        unknown=_unknown(attachment.unknown, where),
        intervals=intervals,
        detected=detected,
        optional=attachment.optional,
    )


def _unknown(lengths_mm: tuple[float, float, float], where: str) -> Array:
    """Unknown lengths (3) [m]."""
    if any(0.0 < length < _LEAST_UNKNOWN_MM for length in lengths_mm):
        raise BodyError(
            f"{where}: unknown is in millimetres, 0 or at least {_LEAST_UNKNOWN_MM:g}; {shown(lengths_mm)} looks like "
            "metres"
        )
    return 1e-3 * np.array(lengths_mm)


def _holds(value: str | list[Interval], where: str) -> tuple[tuple[Interval, ...] | None, bool]:
    """When it holds, None for always, and whether it is detected."""
    if isinstance(value, str):
        if value not in _HOLDS:
            raise BodyError(f"{where} must be detected, always, or a list of intervals [s], not {shown(value)}")
        return None, _HOLDS[value]
    bounds = [bound for interval in value for bound in interval]
    if not np.isfinite(bounds[:-1]).all() or not all(before < after for before, after in pairwise(bounds)):
        raise BodyError(
            f"{where}: intervals are [from, until] [s], one after the other such as [[0, 3.2], [5, .inf]], "
            f"not {shown(value)}"
        )
    return tuple(value), False


def _joint(name: str, entry: _JointEntry) -> Joint:
    joint = joint_of(name, entry)
    if entry.turned_in_parent is None:
        return joint
    if entry.orientation_in_parent != UNTURNED:
        raise BodyError(f"joint {name}: has turned_in_parent and orientation_in_parent; leave out one")
    about_x, about_y, about_z = exp_so3(np.diag(np.radians(entry.turned_in_parent)))
    return replace(joint, parent_T_joint=rigid(about_z @ about_y @ about_x, joint.parent_T_joint[:3, 3]))


def _motion(entry: Any, where: str) -> SegmentMotion:
    motion: SegmentMotion = read_entry(SegmentMotion, entry, where)
    if motion.stands and (idle := [key for key in entry if key != "stands"]):
        raise BodyError(f"{where}: it stands, and so has no {', '.join(idle)}; leave out the one or the other")
    return motion


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
    if standing := [name for name, moves in equipment.segments.items() if moves.stands and name != equipment.root]:
        raise BodyError(f"segment {standing[0]}: stands, which only the root {equipment.root} can; weld it to the root")
    for attachment in equipment.attachments:
        if attachment.equipment_segment not in segments or attachment.body_segment in segments:
            raise BodyError(
                f"attachment {attachment.name}: equipment {attachment.equipment_segment} must be one of the segments "
                f"{', '.join(segments)}, and body {attachment.body_segment} none of them"
            )
    # One root, one tree, joints and cameras on segments that there are.
    tree = BodyModel(equipment.name, equipment.root, segments, equipment.joints, equipment.mounts)
    for joint in tree.loop_joints:
        # It could not be separated from the unknown lengths of the other joints around the loop.
        if joint.name in equipment.unknown:
            raise BodyError(
                f"joint {joint.name}: unknown is for joints that carry their child, but it closes a loop: "
                f"{joint.child} hangs on another joint before it"
            )
