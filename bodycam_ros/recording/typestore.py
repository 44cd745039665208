"""The message types of a recording: ROS 2 Jazzy's and our own, known without ROS."""

from collections.abc import Callable
from functools import cache
from importlib.resources import files
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from bodycam_ros.messages.factory import MessageFactory


@cache
def recording_typestore() -> Typestore:
    """Jazzy's types plus bodycam_msgs, whose definitions travel with this package."""
    typestore = get_typestore(Stores.ROS2_JAZZY)
    for definition in files("bodycam_ros").joinpath("msg").iterdir():
        if definition.name.endswith(".msg"):
            name = f"bodycam_msgs/msg/{definition.name.removesuffix('.msg')}"
            typestore.register(get_types_from_msg(definition.read_text(encoding="utf-8"), name))
    return typestore


@cache
def recorded_messages() -> MessageFactory:
    """Makes messages that a recording stores."""
    types = recording_typestore().types

    def message_class(type_name: str) -> Callable[..., Any]:
        return types[type_name]

    def sequence(values: NDArray[Any]) -> NDArray[np.generic]:
        return values

    return MessageFactory(message_class, sequence)
