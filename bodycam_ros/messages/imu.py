"""Samples of inertial sensors, as messages."""

from bodycam_ros.messages.factory import Message, stamp_ns

IMU_TOPIC, IMU_TYPE = "/imu", "sensor_msgs/msg/Imu"


def imu_row(message: Message) -> tuple[int, tuple[float, ...]]:
    """Stamp [ns], then angular velocity [rad/s] and acceleration [m/s^2] of a sensor_msgs/Imu."""
    w, a = message.angular_velocity, message.linear_acceleration
    return stamp_ns(message.header.stamp), (w.x, w.y, w.z, a.x, a.y, a.z)
