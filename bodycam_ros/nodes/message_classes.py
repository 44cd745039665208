"""rclpy's messages for the converters in ``bodycam_ros.messages``."""

import re
from collections.abc import Callable
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from typing import Any

from bodycam_ros.errors import SettingsError
from bodycam_ros.messages.factory import MessageFactory, live_messages
from bodycam_ros.shown import shown

TRANSFORMS = "tf2_msgs/msg/TFMessage"
"""On every ROS machine; ROS 2's wheels come without it, and `make test` builds it (msg_defs/tf2_msgs)."""

_PREFIX = re.compile(r"(?:[A-Za-z_][\w.-]*/)*(?:[A-Za-z_][\w.-]*)?", re.ASCII)


def is_installed(type_name: str) -> bool:
    """Whether the package of a message type is there."""
    return find_spec(type_name.split("/")[0]) is not None


@cache
def message_class(type_name: str) -> Any:
    """Class of a type such as "sensor_msgs/msg/JointState"."""
    package, _, name = type_name.split("/")
    return getattr(import_module(f"{package}.msg"), name)


def action_class(type_name: str) -> Any:
    """Class of an action such as "bodycam_msgs/action/Calibrate"; None where its package was built without it."""
    package, _, name = type_name.split("/")
    if find_spec(f"{package}.action") is None:
        return None
    return getattr(import_module(f"{package}.action"), name, None)


def node_messages(frame_prefix: str = "") -> MessageFactory:
    """Makes messages that rclpy publishes; transforms come out as None where their package is missing.

    Raises:
        SettingsError: no frame may begin with the prefix: tf2 refuses a slash in front, and names are ASCII.
    """
    if not _PREFIX.fullmatch(frame_prefix):
        raise SettingsError(
            "the parameter 'frame_prefix' must be letters, digits and slashes, none in front, such as anna/; not "
            f"{shown(frame_prefix)}"
        )
    return live_messages(_maker, frame_prefix)


def _maker(type_name: str) -> Callable[..., Any]:
    if type_name == TRANSFORMS and not is_installed(type_name):
        return lambda **fields: None
    maker: Callable[..., Any] = message_class(type_name)
    return maker
