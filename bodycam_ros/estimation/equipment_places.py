"""Where the equipment's joints and attachments are, as far as it has been learned, and what they hold."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.equipment.attachment_joint import attachment_joint
from bodycam_ros.equipment.equipment import Attachment, Equipment
from bodycam_ros.equipment.unknown_lengths import UnknownLengths
from bodycam_ros.estimation.attachment_watch import Holding
from bodycam_ros.estimation.coupling_settings import CouplingSettings
from bodycam_ros.estimation.measurements import ClosedJoint
from bodycam_ros.kinematics.joint import Joint

Array = NDArray[np.float64]

_KERNEL = 4.0
"""Sigmas from which on an attachment counts less and less: one that is let go must not bend a leg."""


class EquipmentPlaces:
    """Learns the unknown lengths of equipment, and makes the joints of an instant of them.

    Args:
        body: with the equipment.
        equipment: its attachments.
        tree: its own joints, parents first.
        lengths: what is unknown of it.
        settings: when attachments give way.

    Attributes:
        shifts: (L) how far what was unknown is from where it was said to be [m].
        sigmas: (L) how well that is known [m].
        own: its own joints, where they have been learned to be.
    """

    def __init__(
        self,
        body: BodyModel,
        equipment: Equipment,
        tree: Sequence[Joint],
        lengths: UnknownLengths,
        settings: CouplingSettings,
    ) -> None:
        self._row, self._attachments, self._tree = body.segment_index, equipment.attachments, tree
        self._lengths, self._settings = lengths, settings
        self.learn(np.zeros(len(lengths)), lengths.priors.copy())

    def learn(self, shifts: Array, sigmas: Array) -> None:
        """The lengths (L) are so, as far as is known by now [m]."""
        self.shifts, self.sigmas = shifts, sigmas
        self.own = [self._lengths.joint(joint, shifts) for joint in self._tree]
        self._shifted = {a.name: self._lengths.attachment(a, shifts) for a in self._attachments}
        self._held = {name: attachment_joint(attachment) for name, attachment in self._shifted.items()}
        self._unknown = {name: self._lengths.along_axes(name, sigmas) for name in self._shifted}

    def joints(self, path: Array, holding: Holding | None) -> list[ClosedJoint]:
        """What holds the equipment to the body, around poses (S, 4, 4) (B eq. 15).

        A place that is not known yet is as soft as that.
        """
        if holding is None:
            return []
        return [self._closed(a, self._ends(a, path), holding) for a in self._attachments if holding.engaged[a.name]]

    def _closed(self, attachment: Attachment, ends: tuple[Array, Array], holding: Holding) -> ClosedJoint:
        joint, unknown = self._held[attachment.name], self._unknown[attachment.name]
        assert joint.sigmas is not None  # set when it was made
        # What is unknown lies along the equipment's axes, the gap in those of the joint on the body.
        body, equipment = (pose[:3, :3] for pose in ends)
        joint_R_equipment = (body @ joint.child_T_joint[:3, :3]).T @ equipment
        covariance = np.diag(np.square(joint.sigmas))
        covariance[3:, 3:] += joint_R_equipment @ np.diag(unknown**2) @ joint_R_equipment.T
        return ClosedJoint(joint, np.linalg.inv(covariance), self._kernel(attachment, holding))

    def distance(self, name: str, world_T_segment: Array) -> float:
        """Mean distance of the points of an attachment [m], of poses (S, 4, 4)."""
        attachment = self._shifted[name]
        return float(attachment.distances(*self._ends(attachment, world_T_segment)).mean())

    def _ends(self, attachment: Attachment, world_T_segment: Array) -> tuple[Array, Array]:
        """Poses (4, 4) of its segments of the body and of the equipment."""
        body, equipment = self._row[attachment.body_segment], self._row[attachment.equipment_segment]
        return world_T_segment[body], world_T_segment[equipment]

    def _kernel(self, attachment: Attachment, holding: Holding) -> float:
        """Sigmas from which on an attachment gives way: unseen, nobody has let it go, and it may begin far off."""
        if attachment.name in holding.seen:
            return _KERNEL
        return max(_KERNEL, self._settings.release_distance / float(attachment.sigmas.min()))
