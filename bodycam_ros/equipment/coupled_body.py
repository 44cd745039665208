"""A body and its equipment as one body: more segments, more rows in the joint table, loops where it is held (B 3)."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.equipment.attachment_joint import attachment_joint
from bodycam_ros.equipment.equipment import Equipment
from bodycam_ros.equipment.equipment_yaml import read_equipment
from bodycam_ros.equipment.fitted_equipment import fitted_equipment
from bodycam_ros.equipment.supplied_equipment import equipment_path
from bodycam_ros.errors import BodyError
from bodycam_ros.kinematics.joint import Joint


def held_equipment(name_or_path: str | Path, body: BodyModel) -> Equipment:
    """The equipment of a name or file, as far as a body can hold it (``fitted_equipment``).

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
    segments hang on each other as its joints say, and every attachment is a joint that closes a loop; optional
    ones that the body cannot hold are left out.

    Raises:
        BodyError: names clash, or an attachment is to a segment that the body does not have; the message names both.
    """
    if equipment is None:
        return body
    equipment = fitted_equipment(equipment, body)
    if twice := sorted(set(equipment.mounts) & set(body.mounts)):
        raise BodyError(f"equipment {equipment.name}: camera {', '.join(twice)} is on body {body.name} as well")
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
