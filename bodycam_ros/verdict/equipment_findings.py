"""What is wrong with the equipment that a recording was solved with: it is not there, or not where its file has it."""

import numpy as np

from bodycam_ros.equipment.equipment_record import EquipmentRecord
from bodycam_ros.verdict.verdict import Finding, Level

_HARDLY = 0.02
"""Share of the instants; an attachment that holds more rarely contradicts what is seen."""

_APART_M = 0.1
"""Farther is no grip that is loose."""


def equipment_findings(record: EquipmentRecord | None) -> tuple[Finding, ...]:
    """A finding for equipment that was never placed, or for each attachment that hardly ever held and is far off.

    The body is solved without what contradicts it, so that none of them makes a result wrong.
    """
    if record is None:
        return ()
    if not record.placed.any():
        what = "where it is was never known, so nothing was coupled to it"
        remedy = "is it the equipment of this recording, do its attachments hold, and are their points right?"
        return (Finding(record.name, Level.DOUBTFUL, what, remedy=remedy, part="equipment"),)
    findings = []
    for column, name in enumerate(record.attachments):
        share = float(record.held[record.placed, column].mean())
        apart = record.deviations[record.placed, column]
        apart = apart[np.isfinite(apart)]
        if share < _HARDLY and apart.size and float(np.median(apart)) > _APART_M:
            what = f"attachment {name} is {float(np.median(apart)):.2g} m from the body where the file has it"
            remedy = "it was not used; check its points, and when it holds"
            findings.append(Finding(record.name, Level.DOUBTFUL, what, remedy=remedy, part="equipment"))
    return tuple(findings)
