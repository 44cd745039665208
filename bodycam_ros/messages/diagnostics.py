"""States of parts of the graph, as published on /diagnostics, and plain text."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import IntEnum

from bodycam_ros.messages.factory import Message, MessageFactory, header_message


class StatusLevel(IntEnum):
    """Levels of diagnostic_msgs/DiagnosticStatus that nodes publish; STALE is the aggregator's, of a silent one."""

    OK = 0
    WARN = 1
    ERROR = 2


@dataclass(frozen=True)
class Status:
    """State of one part, such as a camera.

    Attributes:
        name: the part ("camera head"); a node adds its own name in front.
        level: severity.
        text: summary in one line.
        values: figures by name.
    """

    name: str
    level: StatusLevel
    text: str
    values: Mapping[str, object] = field(default_factory=dict)


def diagnostics_message(make: MessageFactory, stamp_ns: int, parts: Sequence[Status], computer: str = "") -> Message:
    """diagnostic_msgs/DiagnosticArray of parts that run on a computer."""
    statuses = [
        make(
            "diagnostic_msgs/msg/DiagnosticStatus",
            level=make.library.byte(int(part.level)),
            name=part.name,
            hardware_id=computer,
            message=part.text,
            values=[
                make("diagnostic_msgs/msg/KeyValue", key=key, value=str(value)) for key, value in part.values.items()
            ],
        )
        for part in parts
    ]
    return make("diagnostic_msgs/msg/DiagnosticArray", header=header_message(make, stamp_ns, ""), status=statuses)


def text_message(make: MessageFactory, text: str) -> Message:
    """std_msgs/String, such as a URDF."""
    return make("std_msgs/msg/String", data=text)
