"""What nobody measured of the equipment: how far attachments and joints are from where they are said to be."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.equipment.equipment import Attachment, Equipment
from bodycam_ros.kinematics.joint import Joint

Array = NDArray[np.float64]


class UnknownLengths:
    """All (L) lengths of a piece of equipment that are to be estimated.

    Args:
        equipment: which says how far they may be off.
        tree: its own joints.

    Attributes:
        owners: (L) attachment or joint, and the axis 0, 1 or 2 of its equipment segment or parent.
        priors: (L) how far they may be off [m].
        said: (L) where they are said to be, the mean of an attachment's points [m].
    """

    def __init__(self, equipment: Equipment, tree: Sequence[Joint]) -> None:
        unknown = {attachment.name: attachment.unknown for attachment in equipment.attachments}
        unknown |= dict(equipment.unknown)
        places = {attachment.name: attachment.on_equipment.mean(axis=0) for attachment in equipment.attachments}
        places |= {joint.name: joint.parent_T_joint[:3, 3] for joint in tree}
        self.owners = tuple((name, int(axis)) for name, off in unknown.items() for axis in np.flatnonzero(off))
        self.priors = np.array([unknown[name][axis] for name, axis in self.owners])
        self.said = np.array([places[name][axis] for name, axis in self.owners])
        self._of: dict[str, list[tuple[int, int]]] = {name: [] for name in unknown}
        for number, (name, axis) in enumerate(self.owners):
            self._of[name].append((number, axis))

    def __len__(self) -> int:
        return len(self.owners)

    @property
    def names(self) -> tuple[str, ...]:
        """(L) ``<attachment or joint>_<x, y or z>``."""
        return tuple(f"{name}_{'xyz'[axis]}" for name, axis in self.owners)

    def of(self, name: str) -> Sequence[tuple[int, int]]:
        """Number and axis of each length of an attachment or joint."""
        return self._of.get(name, ())

    def along_axes(self, name: str, values: Array) -> Array:
        """(3) values (L) of an attachment's or joint's lengths along its axes; zero along what is known."""
        along = np.zeros(3)
        for number, axis in self.of(name):
            along[axis] = values[number]
        return along

    def attachment(self, attachment: Attachment, shifts: Array) -> Attachment:
        """An attachment where its shifts (L) [m] have it."""
        shift = self.along_axes(attachment.name, shifts)
        return replace(attachment, on_equipment=attachment.on_equipment + shift) if shift.any() else attachment

    def joint(self, joint: Joint, shifts: Array) -> Joint:
        """A joint, or an attachment's (``attachment_joint``), where its shifts (L) [m] have it."""
        shift = self.along_axes(joint.name, shifts)
        if not shift.any():
            return joint
        place = joint.parent_T_joint.copy()
        place[:3, 3] += shift
        return replace(joint, parent_T_joint=place)
