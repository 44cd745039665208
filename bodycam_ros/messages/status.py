"""Text and health."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import IntEnum

from bodycam_ros.messages.factory import Message, MessageFactory
from bodycam_ros.messages.header import header_message

_NAMED = 3


class HealthLevel(IntEnum):
    """Levels of diagnostic_msgs/DiagnosticStatus."""

    OK = 0
    WARN = 1
    ERROR = 2
    STALE = 3


@dataclass(frozen=True)
class Health:
    """The health of one part, such as a camera.

    Attributes:
        name: the part ("camera head"); a node puts its own name before it.
        level: how it is.
        text: why, in one line.
        values: figures that say it in detail.
    """

    name: str
    level: HealthLevel
    text: str
    values: Mapping[str, object] = field(default_factory=dict)


def diagnostics_message(make: MessageFactory, stamp_ns: int, parts: Sequence[Health], computer: str = "") -> Message:
    """diagnostic_msgs/DiagnosticArray; ``computer`` is where the parts are, if that is worth telling."""
    statuses = [
        make(
            "diagnostic_msgs/msg/DiagnosticStatus",
            level=make.byte(int(part.level)),
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


def few(names: Sequence[str]) -> str:
    """The first of some names, and how many more there are, so that a line stays a line."""
    more = f" and {len(names) - _NAMED} more" if len(names) > _NAMED else ""
    return ", ".join(names[:_NAMED]) + more


def text_message(make: MessageFactory, text: str) -> Message:
    """std_msgs/String, such as a URDF."""
    return make("std_msgs/msg/String", data=text)
