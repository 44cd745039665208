"""A body and its equipment as one body: more segments, more rows in the joint table, loops where it is held (B 3)."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.equipment import Equipment, UnknownLengths, attachment_joint, fitted_equipment, unknown_lengths
from bodycam_ros.body.equipment_report import EquipmentReport
from bodycam_ros.body.equipment_yaml import equipment_path, read_equipment
from bodycam_ros.errors import BodyError
from bodycam_ros.geometry import Array
from bodycam_ros.kinematics.joint import LOOSE_M, TIGHT_M, TIGHT_RAD, Joint


def held_equipment(name_or_path: str | Path, body: BodyModel) -> Equipment:
    """The equipment of a name or file, as far as a body can hold it (``equipment``).

    Raises:
        BodyError: it cannot be read, or does not fit the body; the message names the file.
    """
    equipment = read_equipment(name_or_path)
    try:
        held = fitted_equipment(equipment, body)
        coupled_body(body, held)
    except BodyError as error:
        raise BodyError(f"{equipment_path(name_or_path)}: {error}") from error
    return held


def coupled_body(body: BodyModel, equipment: Equipment | None) -> BodyModel:
    """The body with the equipment beside it; the body itself without.

    The equipment's root hangs on the body's by a free joint of the equipment's name, which holds nothing; its own
    segments hang on each other by its joints, and every attachment is a joint that closes a loop; optional
    ones that the body cannot hold are left out.

    Raises:
        BodyError: names clash, or an attachment is to a segment that the body does not have; the message names both.
    """
    if equipment is None:
        return body
    equipment = fitted_equipment(equipment, body)
    if twice := sorted(set(equipment.mounts) & set(body.mounts)):
        raise BodyError(f"equipment {equipment.name}: camera {', '.join(twice)} is on body {body.name} as well")
    if twice := sorted(set(equipment.segments) & set(body.segments)):
        raise BodyError(
            f"equipment {equipment.name}: segment {', '.join(twice)} is one of body {body.name} as well; name the "
            "equipment's otherwise"
        )
    beside = Joint(equipment.name, body.root, equipment.root, "free", np.eye(4))
    try:
        return replace(
            body,
            segments=(*body.segments, *equipment.segments),
            joints=(*body.joints, beside, *equipment.joints, *map(attachment_joint, equipment.attachments)),
            mounts={**body.mounts, **equipment.mounts},
            standing=(*body.standing, *(name for name, motion in equipment.segments.items() if motion.stands)),
        )
    except BodyError as error:
        raise BodyError(f"equipment {equipment.name} with body {body.name}: {error}") from error


def length_joint(name: str) -> str:
    """Name of the joint that slides by what is unknown of the place of an attachment or joint."""
    return f"{name} length"


def body_with_lengths(body: BodyModel, equipment: Equipment) -> BodyModel:
    """The coupled body whose unknown lengths are coordinates.

    An attachment or joint of unknown place is on a small segment of its own, which slides on the equipment's segment
    along the axes that are unknown. These segments come after all others.
    """
    unknown = unknown_lengths(equipment)
    joints = []
    sliders = []
    for joint in body.joints:
        if joint.name in unknown:
            sigmas = (*(TIGHT_RAD,) * 3, *np.where(unknown[joint.name] > 0.0, LOOSE_M, TIGHT_M).tolist())
            place, name = f"{joint.name} place", length_joint(joint.name)
            sliders.append(Joint(name, joint.parent, place, "weld", np.eye(4), sigmas=sigmas))
            joint = replace(joint, parent=place)
        joints.append(joint)
    return replace(body, segments=(*body.segments, *(each.child for each in sliders)), joints=(*joints, *sliders))


_SETTLED_M = 1e-3
_SETTLED_NS = 5_000_000_000
"""Lengths that change by less for so long are settled."""


def learned_body(body: BodyModel, equipment: Equipment, values: Array) -> BodyModel:
    """The body with joints of its equipment, and the loops that its attachments close, at their estimated places.

    Args:
        body: coupled.
        equipment: that it is coupled to, as far as it can hold it.
        values: (L) lengths of the equipment that its file leaves open, in the order of ``UnknownLengths`` [m].
    """
    lengths = UnknownLengths(equipment)
    shifts = values - lengths.given
    return replace(body, joints=tuple(lengths.joint(joint, shifts) for joint in body.joints)) if len(lengths) else body


class SettledLengths:
    """Finds when the lengths that are learned of a piece of equipment have settled.

    Args:
        equipment: that the body is coupled to, as far as it can hold it.
    """

    def __init__(self, equipment: Equipment) -> None:
        self._given = UnknownLengths(equipment).given
        self._values = self._given
        self._since_ns: int | None = None
        self._is_done = not len(self._given)

    def add(self, stamp_ns: int, report: EquipmentReport) -> Array | None:
        """Lengths (L) [m], once: when they have settled at values other than those of the equipment's file."""
        if self._is_done or not report.placed:
            return None
        is_near = bool(np.abs(report.values - self._values).max() < _SETTLED_M)
        if self._since_ns is None or not is_near or stamp_ns < self._since_ns:
            self._values, self._since_ns = report.values, stamp_ns
            return None
        if stamp_ns - self._since_ns < _SETTLED_NS:
            return None
        self._is_done = bool(np.abs(report.values - self._given).max() >= _SETTLED_M)
        return report.values if self._is_done else None
