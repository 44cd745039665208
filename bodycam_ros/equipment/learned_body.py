"""A body with its equipment as it was found to be: what is published fits the motion."""

from dataclasses import replace

import numpy as np

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.equipment.equipment import Equipment
from bodycam_ros.equipment.equipment_report import EquipmentReport
from bodycam_ros.equipment.unknown_lengths import UnknownLengths
from bodycam_ros.geometry import Array

_SETTLED_M = 1e-3
_SETTLED_NS = 5_000_000_000
"""Lengths that change by less for so long, ten fits, are settled."""


def learned_body(body: BodyModel, equipment: Equipment, values: Array) -> BodyModel:
    """The body with joints of its equipment, and the loops that its attachments close, moved to where they were found.

    Args:
        body: coupled.
        equipment: that it is coupled to, as far as it can hold it.
        values: (L) lengths of the equipment that its file leaves open, in the order of ``UnknownLengths`` [m].
    """
    lengths = UnknownLengths(equipment, equipment.joints)
    shifts = values - lengths.said
    return replace(body, joints=tuple(lengths.joint(joint, shifts) for joint in body.joints)) if len(lengths) else body


class SettledLengths:
    """Finds when the lengths that are learned of a piece of equipment have settled.

    Args:
        equipment: that the body is coupled to, as far as it can hold it.
    """

    def __init__(self, equipment: Equipment) -> None:
        self._described = UnknownLengths(equipment, equipment.joints).said
        self._values = self._described
        self._since_ns: int | None = None
        self._is_done = not len(self._described)

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
        self._is_done = bool(np.abs(report.values - self._described).max() >= _SETTLED_M)
        return report.values if self._is_done else None
