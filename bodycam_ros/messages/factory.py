"""Construction of messages of either library, rclpy or rosbags."""

import array
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

Message = Any
"""A message of rclpy or of rosbags. The two share attribute names and nothing else."""


class Stamp(Protocol):
    """A builtin_interfaces/Time of either library."""

    sec: int
    nanosec: int


class MessageLibrary(Protocol):
    """What rclpy and rosbags have each in their own way."""

    def message_class(self, type_name: str) -> Callable[..., Message]:
        """Constructor of messages of a type such as "sensor_msgs/msg/JointState" from fields by name.

        Other fields have the defaults of the message.
        """

    def sequence(self, values: NDArray[Any]) -> Any:
        """Value of a numeric field of dynamic length, of a flat array."""

    def byte(self, value: int) -> Any:
        """Value of a field of type byte."""


@dataclass(frozen=True)
class MessageFactory:
    """Makes messages of one library.

    Attributes:
        library: rclpy's or rosbags' messages.
        frame_prefix: prefix of every frame but the map's, as of robot_state_publisher: several people share one map.
    """

    library: MessageLibrary
    frame_prefix: str = ""

    def frame(self, name: str) -> str:
        """Name on the wire of a segment's, a link's or a camera's frame."""
        return f"{self.frame_prefix}{name}"

    def array(self, values: NDArray[Any] | None, dtype: type[np.generic]) -> Any:
        """Values of any shape, row by row, for a numeric field of dynamic length; None: an empty field."""
        return self.library.sequence(flat(np.zeros(0) if values is None else values, dtype))

    def __call__(self, type_name: str, **fields: Any) -> Message:
        """Make a message; NumPy arrays among the fields must be of the field's dtype and flat."""
        return self.library.message_class(type_name)(**fields)


def array_sequence(values: NDArray[Any]) -> "array.array[Any]":
    """Array that rclpy stores without checking each element: 50 times faster than assigning the NumPy array.

    Args:
        values: flat, of a numeric dtype.
    """
    sequence: array.array[Any] = array.array(values.dtype.char)
    if values.size:
        sequence.frombytes(np.ascontiguousarray(values).data.cast("B"))
    return sequence


def flat(values: NDArray[Any], dtype: type[np.generic]) -> NDArray[Any]:
    """The values row by row as one contiguous array of the dtype."""
    return np.ascontiguousarray(values, dtype=dtype).reshape(-1)


def numbers(field: Any, dtype: type[np.generic], *shape: int) -> NDArray[Any]:
    """An array field (array.array, ndarray or list) as an array of the dtype and shape.

    Raises:
        ValueError: the number of values does not fit the shape.
    """
    if isinstance(field, (array.array, bytes, bytearray, memoryview)):
        return np.frombuffer(field, dtype=dtype).reshape(shape) if len(field) else np.zeros(0, dtype).reshape(shape)
    return np.asarray(field, dtype=dtype).reshape(shape)


MAP_FRAME = "map"
"""The world's frame on the wire: REP-105, z up."""

_SECOND = 1_000_000_000


def stamp_ns(stamp: Stamp) -> int:
    """Nanoseconds of a builtin_interfaces/Time."""
    return int(stamp.sec) * _SECOND + int(stamp.nanosec)


def time_message(make: MessageFactory, ns: int) -> Message:
    """builtin_interfaces/Time of nanoseconds."""
    sec, nanosec = divmod(ns, _SECOND)
    return make("builtin_interfaces/msg/Time", sec=sec, nanosec=nanosec)


def header_message(make: MessageFactory, ns: int, frame_id: str) -> Message:
    """std_msgs/Header."""
    return make("std_msgs/msg/Header", stamp=time_message(make, ns), frame_id=frame_id)
