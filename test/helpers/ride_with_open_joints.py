"""Reports on the equipment of a ride: a foot leaves its pedal for a while, and a bar is somewhere else."""

from pathlib import Path

import numpy as np

from bodycam_ros.body.equipment_report import EquipmentLog, EquipmentRecord, EquipmentReport
from bodycam_ros.messages.body import EQUIPMENT, equipment_message
from bodycam_ros.recording.typestore import recorded_messages
from helpers.known_walk import FRAMES, Walk, write_solved

OFF = range(20, 26)
"""Frames at which the foot is off its pedal."""

APART_M = 3.0
"""Distance of the bar from the hand [m]."""

UNPLACED = range(3)


def report(frame: int) -> EquipmentReport:
    off, placed = frame in OFF, frame not in UNPLACED
    deviations = np.array([0.04 if off else 0.001 + 1e-5 * frame, APART_M])
    return EquipmentReport(
        name="bicycle",
        placed=placed,
        attachments=("pedal_left", "bar"),
        engaged=np.array([placed and not off, False]),
        deviations=deviations if placed else np.full(2, np.nan),
        lengths=("crank_x",),
        priors=np.array([0.02]),
        values=np.array([0.17 - 1e-4 * frame]),
        sigmas=np.array([0.02 / (1.0 + frame)]),
    )


def record(stamps_ns: list[int]) -> EquipmentRecord:
    log = EquipmentLog()
    for frame, stamp_ns in enumerate(stamps_ns):
        log.add(stamp_ns, report(frame))
    made = log.record()
    assert made is not None
    return made


def write_held(ride: Walk, path: Path) -> Path:
    """The bag of the ride, with the reports on its equipment."""
    make = recorded_messages()
    reports = [
        (EQUIPMENT, stamp_ns, equipment_message(make, stamp_ns, report(frame)))
        for frame, stamp_ns in enumerate(ride.stamps_ns[:FRAMES].tolist())
    ]
    return write_solved(ride, path, more=reports)
