"""Time stamps and headers."""

from bodycam_ros.messages.factory import Message, MessageFactory

MAP_FRAME = "map"
"""The world's frame on the wire: REP-105, z up."""

_SECOND = 1_000_000_000


def stamp_ns(stamp: Message) -> int:
    """Nanoseconds of a builtin_interfaces/Time."""
    return int(stamp.sec) * _SECOND + int(stamp.nanosec)


def time_message(make: MessageFactory, ns: int) -> Message:
    """builtin_interfaces/Time of nanoseconds."""
    sec, nanosec = divmod(ns, _SECOND)
    return make("builtin_interfaces/msg/Time", sec=sec, nanosec=nanosec)


def header_message(make: MessageFactory, ns: int, frame_id: str) -> Message:
    """std_msgs/Header."""
    return make("std_msgs/msg/Header", stamp=time_message(make, ns), frame_id=frame_id)


def optical_frame(camera: str) -> str:
    """Frame of a camera's image: z forward, x right, y down."""
    return f"{camera}_optical_frame"
