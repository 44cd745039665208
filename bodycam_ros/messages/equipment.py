"""Coupling of the body to its equipment (bodycam_msgs/EquipmentState)."""

import numpy as np

from bodycam_ros.body.equipment_report import EquipmentReport
from bodycam_ros.messages.factory import MAP_FRAME, Message, MessageFactory, header_message, numbers

EQUIPMENT, EQUIPMENT_TYPE = "/equipment", "bodycam_msgs/msg/EquipmentState"


def equipment_message(make: MessageFactory, stamp_ns: int, report: EquipmentReport) -> Message:
    """bodycam_msgs/EquipmentState at one stamp [ns]."""
    return make(
        EQUIPMENT_TYPE,
        header=header_message(make, stamp_ns, MAP_FRAME),
        name=report.name,
        placed=report.placed,
        attachments=list(report.attachments),
        engaged=make.array(report.engaged, np.uint8),
        deviations=make.array(report.deviations, np.float64),
        lengths=list(report.lengths),
        priors=make.array(report.priors, np.float64),
        values=make.array(report.values, np.float64),
        sigmas=make.array(report.sigmas, np.float64),
    )


def equipment_report(message: Message) -> EquipmentReport:
    """Content of a bodycam_msgs/EquipmentState.

    Raises:
        ValueError: an array does not have one value for each name.
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
