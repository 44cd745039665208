"""Vectors, rotations, transforms and their covariances (geometry_msgs).

Ours: rotation [rad] then translation [m], in the axes of the moving frame (gtsam's order), world_T_body @ exp(xi).
ROS: translation then rotation about the fixed axes of the parent frame (geometry_msgs/PoseWithCovariance).
"""

import numpy as np

from bodycam_ros import geometry
from bodycam_ros.geometry import Array
from bodycam_ros.messages.factory import Message, MessageFactory, numbers


def vector_message(make: MessageFactory, vector: Array) -> Message:
    """geometry_msgs/Vector3 of three numbers."""
    x, y, z = vector.tolist()
    return make("geometry_msgs/msg/Vector3", x=x, y=y, z=z)


def point_message(make: MessageFactory, point: Array) -> Message:
    """geometry_msgs/Point [m]."""
    x, y, z = point.tolist()
    return make("geometry_msgs/msg/Point", x=x, y=y, z=z)


def quaternion_message(make: MessageFactory, a_R_b: Array) -> Message:
    """geometry_msgs/Quaternion of a rotation (3, 3)."""
    x, y, z, w = geometry.quaternion_xyzw(a_R_b).tolist()
    return make("geometry_msgs/msg/Quaternion", x=x, y=y, z=z, w=w)


def rotation_from_message(quaternion: Message) -> Array:
    """Rotation (3, 3) of a geometry_msgs/Quaternion; all zeros, as in an unset field, is the identity."""
    q = np.array([quaternion.x, quaternion.y, quaternion.z, quaternion.w])
    return geometry.rotation_from_xyzw(q) if q.any() else np.eye(3)


def transform_messages(make: MessageFactory, a_T_b: Array) -> list[Message]:
    """geometry_msgs/Transform of transforms (N, 4, 4)."""
    return [
        make(
            "geometry_msgs/msg/Transform",
            translation=make("geometry_msgs/msg/Vector3", x=x, y=y, z=z),
            rotation=make("geometry_msgs/msg/Quaternion", x=qx, y=qy, z=qz, w=qw),
        )
        for (x, y, z), (qx, qy, qz, qw) in zip(
            a_T_b[:, :3, 3].tolist(), geometry.quaternion_xyzw(a_T_b[:, :3, :3]).tolist(), strict=True
        )
    ]


def pose_message(make: MessageFactory, a_T_b: Array) -> Message:
    """geometry_msgs/Pose of a transform (4, 4)."""
    return make(
        "geometry_msgs/msg/Pose",
        position=point_message(make, a_T_b[:3, 3]),
        orientation=quaternion_message(make, a_T_b[:3, :3]),
    )


def transform_from_pose(pose: Message) -> Array:
    """Transform (4, 4) of a geometry_msgs/Pose."""
    position = np.array([pose.position.x, pose.position.y, pose.position.z])
    return geometry.rigid(rotation_from_message(pose.orientation), position)


def pose_with_covariance_message(make: MessageFactory, a_T_b: Array, covariance: Array) -> Message:
    """geometry_msgs/PoseWithCovariance of a transform (4, 4) and its covariance (6, 6) in our order and axes."""
    return make(
        "geometry_msgs/msg/PoseWithCovariance",
        pose=pose_message(make, a_T_b),
        covariance=ros_covariance(a_T_b, covariance).reshape(-1),
    )


def pose_and_covariance(message: Message) -> tuple[Array, Array]:
    """Transform (4, 4) and covariance (6, 6) in our order and axes of a geometry_msgs/PoseWithCovariance."""
    a_T_b = transform_from_pose(message.pose)
    return a_T_b, body_covariance(a_T_b, numbers(message.covariance, np.float64, 6, 6))


def ros_covariance(a_T_b: Array, covariance: Array) -> Array:
    """Covariance (6, 6) in ROS's order and axes from ours.

    From a_T_b @ exp(w, v): the position moves by R v, and R exp(w) = exp(R w) R turns about fixed axes by R w.
    """
    return _reordered(a_T_b[:3, :3], covariance)


def body_covariance(a_T_b: Array, covariance: Array) -> Array:
    """Covariance (6, 6) in our order and axes from ROS's; the inverse of ``ros_covariance``."""
    return _reordered(a_T_b[:3, :3].T, covariance)


def twist_covariance(covariance: Array) -> Array:
    """Covariance (6, 6) of a twist in ROS's order, linear first, from ours, in the same axes."""
    return np.ascontiguousarray(np.roll(covariance, 3, axis=(0, 1)))


def _reordered(rotation: Array, covariance: Array) -> Array:
    """Covariance (6, 6) with its two halves exchanged and both rotated."""
    J = np.zeros((6, 6))
    J[:3, 3:] = J[3:, :3] = rotation
    return np.ascontiguousarray(J @ covariance @ J.T)
