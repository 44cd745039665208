"""rclpy's messages for the converters in ``bodycam_ros.messages``."""

from collections.abc import Callable
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from typing import Any

from bodycam_ros.messages.factory import MessageFactory, live_messages

TRANSFORMS = "tf2_msgs/msg/TFMessage"
"""On every ROS machine; ROS 2's wheels come without it."""


def is_installed(type_name: str) -> bool:
    """Whether the package of a message type is there."""
    return find_spec(type_name.split("/")[0]) is not None


@cache
def message_class(type_name: str) -> Any:
    """Class of a type such as "sensor_msgs/msg/JointState"."""
    package, _, name = type_name.split("/")
    return getattr(import_module(f"{package}.msg"), name)


def node_messages() -> MessageFactory:
    """Makes messages that rclpy publishes; transforms come out as None where their package is missing."""
    return live_messages(_maker)


def _maker(type_name: str) -> Callable[..., Any]:
    if type_name == TRANSFORMS and not is_installed(type_name):
        return lambda **fields: None
    maker: Callable[..., Any] = message_class(type_name)
    return maker
