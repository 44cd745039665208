"""The message types of a recording: ROS 2 Jazzy's and our own, known without ROS."""

from collections.abc import Callable
from functools import cache
from importlib.resources import files
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from bodycam_ros.messages.factory import Message, MessageFactory
from bodycam_ros.messages.images import COMPRESSED_VIDEO

_IDENTITY_W = ("geometry_msgs/msg/Quaternion", "w", 1.0)
"""The one default value in the standard messages that is not zero; rosbags' definitions lack it."""

_COMPRESSED_VIDEO_FIELDS = """\
# A frame of a video: h264 or h265 in the form of Annex B, without B-frames, with the parameters before each keyframe.
builtin_interfaces/Time timestamp
string frame_id
uint8[] data
string format
"""

_ZERO_OF_BASE: dict[str, Any] = {"string": "", "wstring": "", "bool": False, "float32": 0.0, "float64": 0.0}
_DTYPE_OF_BASE = {"byte": "uint8", "char": "uint8"}


@cache
def recording_typestore() -> Typestore:
    """Jazzy's types, Foxglove's video, and bodycam_msgs, whose definitions travel with this package."""
    typestore = get_typestore(Stores.ROS2_JAZZY)
    typestore.register(get_types_from_msg(_COMPRESSED_VIDEO_FIELDS, COMPRESSED_VIDEO))
    for definition in files("bodycam_ros").joinpath("msg").iterdir():
        if definition.name.endswith(".msg"):
            name = f"bodycam_msgs/msg/{definition.name.removesuffix('.msg')}"
            typestore.register(get_types_from_msg(definition.read_text(encoding="utf-8"), name))
    return typestore


@cache
def recorded_messages() -> MessageFactory:
    """Makes messages that a recording stores; fields left out are zero or empty, as in rclpy."""
    return MessageFactory(_RosbagsMessages())


class _RosbagsMessages:
    """Messages that rosbags writes."""

    def message_class(self, type_name: str) -> Callable[..., Message]:
        return _message_class(type_name)

    def sequence(self, values: NDArray[Any]) -> NDArray[Any]:
        return values

    def byte(self, value: int) -> int:
        return value


@cache
def _message_class(type_name: str) -> Callable[..., Message]:
    cls = recording_typestore().types[type_name]
    # Shared among messages, which do not change once they are made.
    zero = {name: _zero(field) for name, field in recording_typestore().fielddefs[type_name][1]}
    if type_name == _IDENTITY_W[0]:
        zero[_IDENTITY_W[1]] = _IDENTITY_W[2]

    def message(**fields: Any) -> Message:
        return cls(**fields) if len(fields) == len(zero) else cls(**(zero | fields))

    return message


def _zero(field: Any) -> Any:
    """Zero of a field as rosbags describes it: (kind of node, its content)."""
    kind, content = field
    if kind == Nodetype.BASE:
        return _ZERO_OF_BASE.get(content[0], 0)
    if kind == Nodetype.NAME:
        return _message_class(content)()
    element, length = content
    if element[0] == Nodetype.NAME or element[1][0] in ("string", "wstring"):
        return [_zero(element) for _ in range(length)]
    base = element[1][0]
    return np.zeros(length, dtype=_DTYPE_OF_BASE.get(base, base))
