"""What travels between the stages: feature tracks, landmark matches, camera poses.

Ours: rotation [rad] then translation [m], in the axes of the moving frame (gtsam's order), world_T_body @ exp(xi).
ROS: translation then rotation about the fixed axes of the parent frame (geometry_msgs/PoseWithCovariance).
"""

import numpy as np
from numpy.typing import NDArray

from bodycam_ros import geometry
from bodycam_ros.messages.factory import (
    MAP_FRAME,
    Message,
    MessageFactory,
    flat,
    header_message,
    numbers,
    optical_frame,
    stamp_ns,
    time_message,
)
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.tracking.keypoints import DESCRIPTOR_LENGTH
from bodycam_ros.tracking.track_frame import TrackFrame


def quaternion_message(make: MessageFactory, a_R_b: NDArray[np.float64]) -> Message:
    """geometry_msgs/Quaternion of a rotation (3, 3)."""
    x, y, z, w = geometry.quaternion_xyzw(a_R_b).tolist()
    return make("geometry_msgs/msg/Quaternion", x=x, y=y, z=z, w=w)


def rotation_from_message(quaternion: Message) -> NDArray[np.float64]:
    """Rotation (3, 3) of a geometry_msgs/Quaternion; all zeros, as an unset field has it, is the identity."""
    q = np.array([quaternion.x, quaternion.y, quaternion.z, quaternion.w])
    return geometry.rotation_from_xyzw(q) if q.any() else np.eye(3)


def vector_message(make: MessageFactory, vector: NDArray[np.float64]) -> Message:
    """geometry_msgs/Vector3 of three numbers."""
    x, y, z = vector.tolist()
    return make("geometry_msgs/msg/Vector3", x=x, y=y, z=z)


def point_message(make: MessageFactory, point: NDArray[np.float64]) -> Message:
    """geometry_msgs/Point [m]."""
    x, y, z = point.tolist()
    return make("geometry_msgs/msg/Point", x=x, y=y, z=z)


def pose_message(make: MessageFactory, a_T_b: NDArray[np.float64]) -> Message:
    """geometry_msgs/Pose of a transform (4, 4)."""
    return make(
        "geometry_msgs/msg/Pose",
        position=point_message(make, a_T_b[:3, 3]),
        orientation=quaternion_message(make, a_T_b[:3, :3]),
    )


def transform_from_pose(pose: Message) -> NDArray[np.float64]:
    """Transform (4, 4) of a geometry_msgs/Pose."""
    position = np.array([pose.position.x, pose.position.y, pose.position.z])
    return geometry.rigid(rotation_from_message(pose.orientation), position)


def transform_messages(make: MessageFactory, a_T_b: NDArray[np.float64]) -> list[Message]:
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


def pose_with_covariance_message(
    make: MessageFactory, a_T_b: NDArray[np.float64], covariance: NDArray[np.float64]
) -> Message:
    """geometry_msgs/PoseWithCovariance of a transform (4, 4) and its covariance (6, 6) in our order and axes."""
    return make(
        "geometry_msgs/msg/PoseWithCovariance",
        pose=pose_message(make, a_T_b),
        covariance=ros_covariance(a_T_b, covariance).reshape(-1),
    )


def stamped_pose_message(
    make: MessageFactory, stamp_ns: int, world_T_body: NDArray[np.float64], covariance: NDArray[np.float64]
) -> Message:
    """geometry_msgs/PoseWithCovarianceStamped in the map, of a transform (4, 4) and its covariance (6, 6)."""
    return make(
        "geometry_msgs/msg/PoseWithCovarianceStamped",
        header=header_message(make, stamp_ns, MAP_FRAME),
        pose=pose_with_covariance_message(make, world_T_body, covariance),
    )


def pose_and_covariance(message: Message) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Transform (4, 4) and covariance (6, 6) in our order and axes of a geometry_msgs/PoseWithCovariance."""
    a_T_b = transform_from_pose(message.pose)
    return a_T_b, body_covariance(a_T_b, numbers(message.covariance, np.float64, 6, 6))


def ros_covariance(a_T_b: NDArray[np.float64], covariance: NDArray[np.float64]) -> NDArray[np.float64]:
    """Covariance (6, 6) in ROS's order and axes from ours.

    From a_T_b @ exp(w, v): the position moves by R v, and R exp(w) = exp(R w) R turns about fixed axes by R w.
    """
    J = np.zeros((6, 6))
    J[:3, 3:] = J[3:, :3] = a_T_b[:3, :3]
    return np.ascontiguousarray(J @ covariance @ J.T)


def body_covariance(a_T_b: NDArray[np.float64], covariance: NDArray[np.float64]) -> NDArray[np.float64]:
    """Covariance (6, 6) in our order and axes from ROS's; the inverse of ``ros_covariance``."""
    J = np.zeros((6, 6))
    J[:3, 3:] = J[3:, :3] = a_T_b[:3, :3].T
    return np.ascontiguousarray(J @ covariance @ J.T)


def tracks_message(make: MessageFactory, frame: TrackFrame) -> Message:
    """bodycam_msgs/FeatureTracks of a track frame."""
    located = frame.world_T_camera is not None
    information = np.zeros((6, 6)) if frame.pose_information is None else frame.pose_information
    return make(
        "bodycam_msgs/msg/FeatureTracks",
        header=header_message(make, frame.stamp_ns, make.frame(optical_frame(frame.camera))),
        previous_stamp=time_message(make, frame.previous_stamp_ns),
        track_ids=make.sequence(flat(frame.track_ids, np.uint32)),
        pixels=make.sequence(flat(frame.pixels, np.float32)),
        described=make.sequence(flat(frame.described, np.uint32)),
        descriptors=make.sequence(flat(frame.descriptors, np.uint8)),
        scales=make.sequence(flat(frame.scales, np.float32)),
        keyframe=bool(frame.keyframe),
        current_r_previous=quaternion_message(make, frame.current_R_previous),
        landmark_ids=make.sequence(flat(np.zeros(0) if frame.landmark_ids is None else frame.landmark_ids, np.uint32)),
        rotation_inliers=int(frame.rotation_inliers),
        located=located,
        pose=pose_message(make, np.eye(4) if frame.world_T_camera is None else frame.world_T_camera),
        pose_information=flat(information, np.float64),
        shifts=make.sequence(flat(np.zeros(0) if frame.shifts is None else frame.shifts, np.float64)),
    )


def track_frame(message: Message, camera: str) -> TrackFrame:
    """Track frame of a bodycam_msgs/FeatureTracks that came on the camera's topic.

    Raises:
        ValueError: the lengths of the arrays disagree.
    """
    track_count, described_count = len(message.track_ids), len(message.described)
    return TrackFrame(
        camera=camera,
        stamp_ns=stamp_ns(message.header.stamp),
        previous_stamp_ns=stamp_ns(message.previous_stamp),
        track_ids=numbers(message.track_ids, np.uint32, track_count),
        pixels=numbers(message.pixels, np.float32, track_count, 2),
        described=numbers(message.described, np.uint32, described_count),
        descriptors=numbers(message.descriptors, np.uint8, described_count, DESCRIPTOR_LENGTH),
        scales=numbers(message.scales, np.float32, described_count),
        keyframe=bool(message.keyframe),
        current_R_previous=rotation_from_message(message.current_r_previous),
        rotation_inliers=int(message.rotation_inliers),
        landmark_ids=numbers(message.landmark_ids, np.uint32, track_count) if len(message.landmark_ids) else None,
        world_T_camera=transform_from_pose(message.pose) if message.located else None,
        pose_information=numbers(message.pose_information, np.float64, 6, 6) if message.located else None,
        shifts=numbers(message.shifts, np.float64, track_count, 2) if message.located else None,
    )


def landmarks_message(make: MessageFactory, matches: LandmarkMatches) -> Message:
    """bodycam_msgs/LandmarkMatches of landmark matches."""
    registered = matches.world_T_camera is not None
    world_T_camera = np.eye(4) if matches.world_T_camera is None else matches.world_T_camera
    return make(
        "bodycam_msgs/msg/LandmarkMatches",
        header=header_message(make, matches.stamp_ns, make.frame(optical_frame(matches.camera))),
        previous_stamp=time_message(make, matches.previous_stamp_ns),
        track_ids=make.sequence(flat(matches.track_ids, np.uint32)),
        landmark_ids=make.sequence(flat(matches.landmark_ids, np.uint32)),
        pixels=make.sequence(flat(matches.pixels, np.float32)),
        shifts=make.sequence(flat(np.zeros(0) if matches.shifts is None else matches.shifts, np.float32)),
        points=make.sequence(flat(matches.points_world, np.float32)),
        registered=registered,
        pose=pose_with_covariance_message(make, world_T_camera, matches.pose_covariance),
        current_r_previous=quaternion_message(make, matches.current_R_previous),
        rotation_inliers=int(matches.rotation_inliers),
        readout_time=float(matches.readout_time),
        readout_sigma=float(matches.readout_sigma),
        grown=int(matches.grown),
    )


def landmark_matches(message: Message, camera: str) -> LandmarkMatches:
    """Landmark matches of a bodycam_msgs/LandmarkMatches that came on the camera's topic.

    Raises:
        ValueError: the lengths of the arrays disagree, or a registered pose is not finite.
    """
    count = len(message.track_ids)
    world_T_camera, covariance = pose_and_covariance(message.pose)
    if message.registered and not (np.isfinite(world_T_camera).all() and np.isfinite(covariance).all()):
        raise ValueError("a registered pose, or its covariance, is not finite")
    return LandmarkMatches(
        camera=camera,
        stamp_ns=stamp_ns(message.header.stamp),
        previous_stamp_ns=stamp_ns(message.previous_stamp),
        track_ids=numbers(message.track_ids, np.uint32, count),
        landmark_ids=numbers(message.landmark_ids, np.uint32, count),
        pixels=numbers(message.pixels, np.float32, count, 2),
        points_world=numbers(message.points, np.float32, count, 3),
        world_T_camera=world_T_camera if message.registered else None,
        pose_covariance=covariance,
        current_R_previous=rotation_from_message(message.current_r_previous),
        rotation_inliers=int(message.rotation_inliers),
        shifts=numbers(message.shifts, np.float32, count, 2) if len(message.shifts) else None,
        readout_time=float(message.readout_time),
        readout_sigma=float(message.readout_sigma),
        grown=int(message.grown),
    )


def camera_pose_message(make: MessageFactory, matches: LandmarkMatches) -> Message | None:
    """geometry_msgs/PoseWithCovarianceStamped of the optical frame in the map; None while the camera is lost."""
    if matches.world_T_camera is None:
        return None
    return stamped_pose_message(make, matches.stamp_ns, matches.world_T_camera, matches.pose_covariance)


_FLOAT32 = 7  # sensor_msgs/PointField
_FIELDS = ("x", "y", "z", "rgb")


def map_points_message(
    make: MessageFactory, stamp_ns: int, points_world: NDArray[np.floating], colours: NDArray[np.uint8]
) -> Message:
    """sensor_msgs/PointCloud2 of coloured points in the map's frame.

    Args:
        points_world: (N, 3) [m].
        colours: (N, 3) red, green, blue.
    """
    rgb = colours.astype(np.uint32) @ np.array([1 << 16, 1 << 8, 1], dtype=np.uint32)
    # RViz reads a colour from the bits of a float.
    rows = np.column_stack([points_world.astype(np.float32), rgb.astype(np.uint32).view(np.float32)])
    step = 4 * len(_FIELDS)
    return make(
        "sensor_msgs/msg/PointCloud2",
        header=header_message(make, stamp_ns, MAP_FRAME),
        height=1,
        width=len(rows),
        fields=[
            make("sensor_msgs/msg/PointField", name=name, offset=4 * i, datatype=_FLOAT32, count=1)
            for i, name in enumerate(_FIELDS)
        ],
        is_bigendian=False,
        point_step=step,
        row_step=step * len(rows),
        data=make.sequence(flat(rows, np.float32).view(np.uint8)),
        is_dense=True,
    )
