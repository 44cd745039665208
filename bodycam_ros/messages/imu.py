"""Samples of inertial sensors (sensor_msgs/Imu)."""

import numpy as np

from bodycam_ros.geometry import Array
from bodycam_ros.messages.factory import Message, MessageFactory, header_message, stamp_ns
from bodycam_ros.messages.poses import vector_message

IMU_TOPIC, IMU_TYPE = "/imu", "sensor_msgs/msg/Imu"


def imu_row(message: Message) -> tuple[int, tuple[float, ...]]:
    """Stamp [ns], then angular velocity [rad/s] and acceleration [m/s^2] of a sensor_msgs/Imu."""
    w, a = message.angular_velocity, message.linear_acceleration
    return stamp_ns(message.header.stamp), (w.x, w.y, w.z, a.x, a.y, a.z)


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
