"""How a body is coupled to its equipment, as a message and back."""

import numpy as np

from bodycam_ros.equipment.equipment_report import EquipmentReport
from bodycam_ros.messages.factory import Message, MessageFactory, flat, numbers
from bodycam_ros.messages.header import MAP_FRAME, header_message

EQUIPMENT, EQUIPMENT_TYPE = "/equipment", "bodycam_msgs/msg/EquipmentState"


def equipment_message(make: MessageFactory, stamp_ns: int, report: EquipmentReport) -> Message:
    """bodycam_msgs/EquipmentState of one instant."""
    return make(
        EQUIPMENT_TYPE,
        header=header_message(make, stamp_ns, MAP_FRAME),
        name=report.name,
        placed=report.placed,
        attachments=list(report.attachments),
        engaged=make.sequence(flat(report.engaged, np.uint8)),
        deviations=make.sequence(flat(report.deviations, np.float64)),
        lengths=list(report.lengths),
        priors=make.sequence(flat(report.priors, np.float64)),
        values=make.sequence(flat(report.values, np.float64)),
        sigmas=make.sequence(flat(report.sigmas, np.float64)),
    )


def equipment_report(message: Message) -> EquipmentReport:
    """What a bodycam_msgs/EquipmentState says.

    Raises:
        ValueError: its arrays do not have one value for each name.
    """
    attachments, lengths = tuple(message.attachments), tuple(message.lengths)
    return EquipmentReport(
        name=message.name,
        placed=bool(message.placed),
        attachments=attachments,
        engaged=numbers(message.engaged, np.uint8, len(attachments)).astype(bool),
        deviations=numbers(message.deviations, np.float64, len(attachments)),
        lengths=lengths,
        priors=numbers(message.priors, np.float64, len(lengths)),
        values=numbers(message.values, np.float64, len(lengths)),
        sigmas=numbers(message.sigmas, np.float64, len(lengths)),
    )
