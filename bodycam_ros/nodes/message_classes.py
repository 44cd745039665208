"""rclpy's messages for the converters in ``bodycam_ros.messages``."""

from functools import cache
from importlib import import_module
from typing import Any

from bodycam_ros.messages.factory import MessageFactory, live_messages


@cache
def message_class(type_name: str) -> Any:
    """Class of a type such as "sensor_msgs/msg/JointState"."""
    package, _, name = type_name.split("/")
    return getattr(import_module(f"{package}.msg"), name)


def node_messages() -> MessageFactory:
    """Makes messages that rclpy publishes."""
    return live_messages(message_class)
