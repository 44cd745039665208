"""What is wrong with the equipment that a recording was solved with: it is not there, or not where its file has it."""

from collections.abc import Iterator

import numpy as np

from bodycam_ros.body.equipment import Attachment, Equipment, UnknownLengths
from bodycam_ros.body.equipment_report import EquipmentRecord
from bodycam_ros.verdict import Finding, Level

_HARDLY = 0.02
"""Share of the instants; an attachment that holds more rarely contradicts what is seen."""

_MOSTLY = 0.5
"""Share of the instants; equipment that nothing holds for longer may be of another recording."""

_OFTEN = 0.25
"""Share of the instants; an attachment that is let go for longer either is, or is somewhere else."""

_APART_M = 0.1
"""Farther is no grip that is loose."""

_APART_SIGMAS = 5.0
"""Farther, while it holds, is none either; of what is said to be within millimetres that is less than the above."""

_OFF_PRIORS = 3.0
"""A length that is farther from where the file has it is not what the file says."""

_IS_IT_THIS = "is it the equipment of this recording, and are its points right?"

_Doubt = tuple[str, str]
"""Observation and remedy."""


def equipment_findings(record: EquipmentRecord | None, equipment: Equipment | None = None) -> tuple[Finding, ...]:
    """A finding for equipment that was never placed or mostly let go, else for each attachment or length that is off.

    The body is solved without what contradicts it, so that none of them makes a result wrong.

    Args:
        record: of how the body was coupled; None without.
        equipment: that it was coupled to; only where its file is known can its weights, times and lengths be held
            against it.
    """
    if record is None:
        return ()
    doubts: list[_Doubt]
    if not record.placed.any():
        doubts = [("where it is was never known, so nothing was coupled to it", _IS_IT_THIS)]
    elif (alone := 1.0 - float(record.held[record.placed].any(axis=1).mean())) > _MOSTLY:
        doubts = [(f"nothing held it for {alone:.0%} of the time", _IS_IT_THIS)]
    else:
        attachments = {} if equipment is None else {each.name: each for each in equipment.attachments}
        asked = [_attachment_doubt(record, k, attachments.get(name)) for k, name in enumerate(record.attachments)]
        doubts = [doubt for doubt in asked if doubt]
        if equipment is not None:
            doubts += _far_lengths(record, equipment)
    return tuple(Finding(record.name, Level.DOUBTFUL, what, remedy=remedy, part="equipment") for what, remedy in doubts)


def _attachment_doubt(record: EquipmentRecord, column: int, attachment: Attachment | None) -> _Doubt | None:
    """What is wrong with an attachment, if its points are far from each other or it is let go for long."""
    held, name = record.held[record.placed, column], record.attachments[column]
    share = float(held.mean())
    is_used = share >= _HARDLY
    apart = record.deviations[record.placed, column][held if is_used else ~held]
    apart_m = float(np.median(apart[np.isfinite(apart)])) if np.isfinite(apart).any() else 0.0
    far_m = _APART_M
    if attachment is not None and is_used:
        far_m = min(far_m, _APART_SIGMAS * float(attachment.sigmas.mean()))
    if apart_m > far_m:
        what = f"attachment {name} is {apart_m:.2g} m from the body where the file has it"
        if is_used:
            return what, "it pulled at the body all the same; check its points, and when it holds"
        return what, "it was not used; check its points, and when it holds"
    if attachment is not None and attachment.intervals is None and is_used and 1.0 - share > _OFTEN:
        what = f"attachment {name} was let go for {1.0 - share:.0%} of the time"
        return what, "if the body held it, check its points and weights; else say in its file when it holds"
    return None


def _far_lengths(record: EquipmentRecord, equipment: Equipment) -> Iterator[_Doubt]:
    """Lengths that were found much farther from where the file has them than it says."""
    lengths = UnknownLengths(equipment, equipment.joints)
    said = dict(zip(lengths.names, lengths.given.tolist(), strict=True))
    for name, prior, value in zip(record.lengths, record.priors.tolist(), record.values.tolist(), strict=True):
        off = abs(value - said[name]) / prior
        if off > _OFF_PRIORS:
            yield (
                f"length {name} came out as {1e3 * value:.0f} mm, {off:.1f} times as far from the file's "
                f"{1e3 * said[name]:.0f} mm as that says it may be",
                "measure it, or check what hangs on it",
            )
