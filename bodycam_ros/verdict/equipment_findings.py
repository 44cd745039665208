"""What is wrong with the equipment that a recording was solved with: it is not there, or not where its file has it."""

import numpy as np

from bodycam_ros.equipment.equipment_record import EquipmentRecord
from bodycam_ros.verdict.verdict import Finding, Level

_HARDLY = 0.02
"""Share of the instants; an attachment that holds more rarely contradicts what is seen."""

_MOSTLY = 0.5
"""Share of the instants; equipment that nothing holds for longer may be of another recording."""

_APART_M = 0.1
"""Farther is no grip that is loose."""

_IS_IT_THIS = "is it the equipment of this recording, and are its points right?"


def equipment_findings(record: EquipmentRecord | None) -> tuple[Finding, ...]:
    """A finding for equipment that was never placed or mostly let go, else for each attachment that is far off.

    The body is solved without what contradicts it, so that none of them makes a result wrong.
    """
    if record is None:
        return ()
    if not record.placed.any():
        doubts = [("where it is was never known, so nothing was coupled to it", _IS_IT_THIS)]
    elif (alone := 1.0 - float(record.held[record.placed].any(axis=1).mean())) > _MOSTLY:
        doubts = [(f"nothing held it for {alone:.0%} of the time", _IS_IT_THIS)]
    else:
        doubts = [doubt for column in range(len(record.attachments)) if (doubt := _far_off(record, column))]
    return tuple(Finding(record.name, Level.DOUBTFUL, what, remedy=remedy, part="equipment") for what, remedy in doubts)


def _far_off(record: EquipmentRecord, column: int) -> tuple[str, str] | None:
    """What is wrong with an attachment and what to do, if its points are far from each other."""
    held = record.held[record.placed, column]
    is_used = float(held.mean()) >= _HARDLY
    apart = record.deviations[record.placed, column][held if is_used else ~held]
    apart_m = float(np.median(apart[np.isfinite(apart)])) if np.isfinite(apart).any() else 0.0
    if apart_m <= _APART_M:
        return None
    what = f"attachment {record.attachments[column]} is {apart_m:.2g} m from the body where the file has it"
    if is_used:
        return what, "it pulled at the body all the same; check its points, and when it holds"
    return what, "it was not used; check its points, and when it holds"
