"""Equipment as far as a body can hold it: a body of two legs rides a bicycle without touching its bar."""

import logging
from dataclasses import replace

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.equipment.equipment import Equipment
from bodycam_ros.errors import BodyError

logger = logging.getLogger(__name__)


def fitted_equipment(equipment: Equipment, body: BodyModel) -> Equipment:
    """The equipment without its optional attachments to segments that the body does not have; each is logged.

    Raises:
        BodyError: a needed attachment is to such a segment, or none is left; the message names both.
    """
    missing = [each for each in equipment.attachments if each.body_segment not in body.segments]
    if not missing:
        return equipment
    has = f"body {body.name} does not have; it has {', '.join(body.segments)}"
    if needed := [each for each in missing if not each.optional]:
        name, segment = needed[0].name, needed[0].body_segment
        raise BodyError(f"equipment {equipment.name}: attachment {name} is to segment {segment}, which {has}")
    if len(missing) == len(equipment.attachments):
        segments = ", ".join(sorted({each.body_segment for each in missing}))
        raise BodyError(f"equipment {equipment.name}: all of its attachments are to {segments}, which {has}")
    for each in missing:
        logger.warning(
            "equipment %s: attachment %s is left out: body %s has no %s",
            equipment.name, each.name, body.name, each.body_segment,
        )  # fmt: skip
    return replace(equipment, attachments=tuple(each for each in equipment.attachments if each not in missing))
