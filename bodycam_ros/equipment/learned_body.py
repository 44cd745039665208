"""A body with its equipment as it was found to be: what is published fits the motion."""

from dataclasses import replace

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.equipment.equipment import Equipment
from bodycam_ros.equipment.unknown_lengths import UnknownLengths
from bodycam_ros.geometry import Array


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
