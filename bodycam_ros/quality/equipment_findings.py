"""Faults of the equipment that a recording was solved with: it is not there, or not where its file has it."""

from collections.abc import Iterator

import numpy as np

from bodycam_ros.body.equipment import Attachment, Equipment, UnknownLengths
from bodycam_ros.body.equipment_report import EquipmentRecord
from bodycam_ros.results.verdict import Finding, Level

_UNUSED = 0.02  # share of the states; an attachment that is active for less contradicts the cameras
_ALONE = 0.5  # share of the states; equipment without an active attachment for longer may be of another recording
_OFTEN = 0.25  # share of the states; an attachment that is released for longer may be somewhere else
_APART_M, _APART_SIGMAS = 0.1, 5.0  # no loose grip is farther; nor, while active, as many sigmas of its file
_OFF_PRIORS = 3.0  # sigmas of the file that a length may be off
_IS_IT_THIS = "check that it is the equipment of this recording, and that its points are right"

_Fault = tuple[str, str]
"""Observation and remedy."""


def equipment_findings(record: EquipmentRecord | None, equipment: Equipment | None = None) -> tuple[Finding, ...]:
    """A finding for equipment that was never placed or mostly released, else for each attachment or length that is off.

    The body is solved without what contradicts it, so that none of them makes a result wrong.

    Args:
        record: of how the body was coupled; None without.
        equipment: that it was coupled to, for the weights, times and lengths of its file; None if that is unknown.
    """
    if record is None:
        return ()
    if not record.placed.any():
        faults = [("its pose was never known, so the body was not coupled to it", _IS_IT_THIS)]
    elif (alone := 1.0 - float(record.held[record.placed].any(axis=1).mean())) > _ALONE:
        faults = [(f"no attachment was active for {alone:.0%} of the time", _IS_IT_THIS)]
    else:
        known = {} if equipment is None else {each.name: each for each in equipment.attachments}
        faults = [
            fault
            for column, name in enumerate(record.attachments)
            if (fault := _attachment_fault(record, column, known.get(name))) is not None
        ]
        faults += [] if equipment is None else _far_lengths(record, equipment)
    return tuple(
        Finding(record.name, Level.DOUBTFUL, what, remedy=remedy, part="equipment", check="equipment")
        for what, remedy in faults
    )


def _attachment_fault(record: EquipmentRecord, column: int, attachment: Attachment | None) -> _Fault | None:
    """The fault of an attachment whose points are far from each other, or that is released for long."""
    held, name = record.held[record.placed, column], record.attachments[column]
    share = float(held.mean())
    is_used = share >= _UNUSED
    apart = record.deviations[record.placed, column][held if is_used else ~held]
    apart_m = float(np.median(apart[np.isfinite(apart)])) if np.isfinite(apart).any() else 0.0
    far_m = _APART_M
    if attachment is not None and is_used:
        far_m = min(far_m, _APART_SIGMAS * float(attachment.sigmas.mean()))
    if apart_m > far_m:
        effect = "it was active and distorts the body" if is_used else "it was not used"
        what = f"attachment {name} is {apart_m:.2g} m from the body where the file has it"
        return what, f"{effect}; check its points, and the times at which it is active"
    if attachment is not None and attachment.intervals is None and is_used and 1.0 - share > _OFTEN:
        what = f"attachment {name} was released for {1.0 - share:.0%} of the time"
        return what, "if it was attached, check its points and weights; if not, give the times in its file (holds)"
    return None


def _far_lengths(record: EquipmentRecord, equipment: Equipment) -> Iterator[_Fault]:
    """Lengths much farther from the file's than its sigmas."""
    lengths = UnknownLengths(equipment)
    given = dict(zip(lengths.names, lengths.given.tolist(), strict=True))
    for name, prior, value in zip(record.lengths, record.priors.tolist(), record.values.tolist(), strict=True):
        off = abs(value - given[name]) / prior
        if off > _OFF_PRIORS:
            yield (
                f"length {name} is estimated as {1e3 * value:.0f} mm; the equipment file has "
                f"{1e3 * given[name]:.0f} mm, {off:.1f} of its standard deviations away",
                "measure this length; check the points of the attachments on this part",
            )
