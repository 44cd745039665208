"""Samples of inertial sensors (sensor_msgs/Imu)."""

from struct import Struct, error

import numpy as np

from bodycam_ros.geometry import Array
from bodycam_ros.messages.factory import Message, MessageFactory, header_message, stamp_ns
from bodycam_ros.messages.poses import vector_message

IMU_TOPIC, IMU_TYPE = "/imu", "sensor_msgs/msg/Imu"


def imu_row(message: Message) -> tuple[int, tuple[float, ...]]:
    """Stamp [ns], then angular velocity [rad/s] and acceleration [m/s^2] of a sensor_msgs/Imu."""
    w, a = message.angular_velocity, message.linear_acceleration
    return stamp_ns(message.header.stamp), (w.x, w.y, w.z, a.x, a.y, a.z)


_TO_LENGTH, _TO_TEXT = 12, 16  # bytes of CDR before the length of the frame's name, and before the name
_VELOCITY, _ACCELERATION = 8 * 13, 8 * 25  # bytes before them, behind the name: orientation and covariances
_LITTLE, _BIG = (
    tuple(Struct(order + layout) for layout in ("iI", "I", "3d")) for order in ("<", ">")
)  # stamp, length, vector


def imu_row_of_cdr(cdr: bytes) -> tuple[int, tuple[float, ...]]:
    """The same of a serialized message: thousands come in a second, and rclpy takes 20 us to make each of them.

    Raises:
        ValueError: it is too short.
    """
    stamp, length, vector = _LITTLE if cdr[1] & 1 else _BIG
    try:
        seconds, nanoseconds = stamp.unpack_from(cdr, 4)
        # Numbers are aligned to their size, from behind the four bytes of CDR's byte order.
        start = 4 - (-(_TO_TEXT - 4 + length.unpack_from(cdr, _TO_LENGTH)[0]) // 8) * 8
        readings = (*vector.unpack_from(cdr, start + _VELOCITY), *vector.unpack_from(cdr, start + _ACCELERATION))
    except error as fault:
        raise ValueError(f"sensor_msgs/Imu of {len(cdr)} bytes: {fault}") from fault
    return seconds * 1_000_000_000 + nanoseconds, readings


def imu_message(make: MessageFactory, camera: str, stamp: int, angular_velocity: Array, acceleration: Array) -> Message:
    """sensor_msgs/Imu of a camera's sensor without an orientation (REP-145).

    Args:
        stamp: [ns].
        angular_velocity, acceleration: (3,) in the sensor's frame [rad/s], [m/s^2].
    """
    return make(
        IMU_TYPE,
        header=header_message(make, stamp, f"{camera}_imu_frame"),
        orientation_covariance=np.array([-1.0, *[0.0] * 8]),
        angular_velocity=vector_message(make, angular_velocity),
        linear_acceleration=vector_message(make, acceleration),
    )
